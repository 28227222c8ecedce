"""Shows a recording of tricurve in Rerun: points in space with the cameras, images, disparities, log.

    pip install rerun-sdk
    python layout.py [RECORDING.mcap] [--save FILE.rrd]

Rerun's own options say where it is shown; without one its viewer is opened.
"""

import argparse
import pathlib

import rerun as rr
import rerun.blueprint as rrb

RECORDING = @recording@
VIEWS = @views@
# What is drawn in space, in metres, in the frame world: x forward, y to the left, z up.
POINTS = @points@
# The frame that they are given in, said before the first of them comes: Rerun marks what it finds no frame for.
FRAME = @frame@
EYE = @eye@
TARGET = @target@


def blueprint():
    space = rrb.Spatial3DView(
        name="points in space",
        contents=["/tf", *POINTS, *(f"/camera/{view}/calibration" for view in VIEWS)],
        spatial_information=rrb.SpatialInformation(target_frame="world"),
        eye_controls=rrb.EyeControls3D(position=EYE, look_target=TARGET, eye_up=(0, 0, 1)),
        overrides={
            topic: [
                rr.Points3D.from_fields(colors=[0x33D0F0FF], radii=rr.Radius.ui_points(1.2)),
                rr.CoordinateFrame(FRAME),
            ]
            for topic in POINTS
        },
    )
    disparity = rrb.Spatial2DView(origin="/disparity/picture", name="disparity")
    images = [rrb.Spatial2DView(origin=f"/camera/{view}/image", name=view) for view in VIEWS]
    log = rrb.TextLogView(origin="/log", name="log")
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(space, disparity, column_shares=[3, 2]),
            rrb.Horizontal(*images, log),
            row_shares=[3, 2],
        ),
        collapse_panels=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", nargs="?", default=RECORDING, type=pathlib.Path)
    rr.script_add_args(parser)
    args = parser.parse_args()
    rr.script_setup(args, args.recording.stem, default_blueprint=blueprint())
    rr.log_file_from_path(args.recording)
    rr.script_teardown(args)


if __name__ == "__main__":
    main()
