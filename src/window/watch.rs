//! Files that are read anew when somebody has written them.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Time between two looks at the files.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A file with the time of its last change, as far as it is known.
type Seen = (PathBuf, Option<SystemTime>);

/// Some files and when they were changed last.
#[derive(Debug)]
pub struct Watch {
    files: Vec<Seen>,
    looked: Instant,
}

impl Watch {
    pub fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let seen = files.into_iter().map(|file| (changed_at(&file), file)).map(|(at, file)| (file, at));
        Watch { files: seen.collect(), looked: Instant::now() }
    }

    /// True where a file was written since the last look; looks twice a second at most. A file that is away for a moment, as editors
    /// leave it while they save, is no change.
    pub fn has_changed(&mut self) -> bool {
        if self.looked.elapsed() < LOOK_EVERY {
            return false;
        }
        self.looked = Instant::now();
        self.look()
    }

    fn look(&mut self) -> bool {
        let mut changed = false;
        for (file, seen) in &mut self.files {
            let now = changed_at(file);
            if now.is_some() && now != *seen {
                changed |= seen.replace(now.unwrap_or(SystemTime::UNIX_EPOCH)).is_some();
            }
        }
        changed
    }
}

fn changed_at(file: &Path) -> Option<SystemTime> {
    std::fs::metadata(file).and_then(|m| m.modified()).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_written_file_is_noticed_once() {
        let folder = std::env::temp_dir().join(format!("stylet-watch-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("scene.toml");
        std::fs::write(&file, "a").unwrap();
        let mut watch = Watch::new([file.clone()]);
        assert!(!watch.look());
        let later = SystemTime::now() + Duration::from_secs(2);
        std::fs::File::options().write(true).open(&file).unwrap().set_modified(later).unwrap();
        assert!(watch.look() && !watch.look());
        std::fs::remove_file(&file).unwrap();
        assert!(!watch.look(), "an editor saves");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
