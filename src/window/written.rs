//! Where an attempt is written to while it goes on.

use super::practice::Leader;
use crate::Result;
use crate::output::{OutputFolder, Tables};
use crate::session::{SESSION, Session, SessionFile};

/// Where an attempt is written to.
pub(super) struct Written {
    pub(super) folder: OutputFolder,
    pub(super) tables: Tables,
    /// Where a hand leads.
    pub(super) session: Option<SessionFile>,
}

/// The file of what a hand does.
pub(super) fn session_file(folder: &OutputFolder, leader: Leader, session: &Session) -> Result<Option<SessionFile>> {
    match leader {
        Leader::Hand => SessionFile::create(&folder.file(SESSION), session).map(Some),
        Leader::Script => Ok(None),
    }
}
