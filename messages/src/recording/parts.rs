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

/// The parts that lie beyond the first that is not there.
pub fn stray_parts(recording: &Path) -> Vec<PathBuf> {
    let next = count_parts(recording);
    let folder = recording
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    let Ok(entries) = std::fs::read_dir(folder.unwrap_or(Path::new("."))) else {
        return Vec::new();
    };
    let names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
    let number = |name: &std::ffi::OsString| {
        // Between the stem and the extension.
        let stem = Path::new(name).file_stem()?;
        Path::new(stem).extension()?.to_str()?.parse::<u32>().ok()
    };
    let mut numbers: Vec<u32> = names
        .iter()
        .filter_map(number)
        .filter(|n| *n > next)
        .collect();
    numbers.sort_unstable();
    numbers.dedup();
    let paths = numbers
        .into_iter()
        .map(|number| part_path(recording, number));
    paths.filter(|path| path.exists()).collect()
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
