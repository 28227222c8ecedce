//! The parts of a recording: `art.mcap`, `art.1.mcap`, `art.2.mcap` …

use std::path::{Path, PathBuf};

/// The path of a part; part 0 is the recording's own path.
pub fn part_path(recording: &Path, part: u32) -> PathBuf {
    if part == 0 {
        return recording.to_owned();
    }
    let extension = recording
        .extension()
        .map(|e| e.to_string_lossy().into_owned());
    let extension = extension.map_or_else(String::new, |e| format!(".{e}"));
    let stem = recording.file_stem().unwrap_or_default().to_string_lossy();
    recording.with_file_name(format!("{stem}.{part}{extension}"))
}

/// How many parts of this path there are, one after the other, whosoever they are.
pub fn count_parts(recording: &Path) -> u32 {
    (0..)
        .find(|part| !part_path(recording, *part).exists())
        .unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_numbered_before_the_extension() {
        let part = |path: &str, n| part_path(Path::new(path), n).display().to_string();
        assert_eq!(part("runs/art.mcap", 0), "runs/art.mcap");
        assert_eq!(part("runs/art.mcap", 2), "runs/art.2.mcap");
        assert_eq!(part("art.night.mcap", 1), "art.night.1.mcap");
        assert_eq!(part("art", 1), "art.1");
    }
}
