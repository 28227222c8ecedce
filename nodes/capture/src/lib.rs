//! Where scans come from: rendered scenes, folders of images, calibration
