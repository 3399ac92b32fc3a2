//! A copy of a database that may be in use.

use std::path::Path;

use super::{beside, cannot, connect, copy, failed, remove, sync_folder};
use crate::error::Result;
use crate::maintenance::CopyReport;

/// See [`crate::backup`].
pub(crate) async fn backup(path: &Path, to: &Path) -> Result<CopyReport> {
    if to.exists() {
        return Err(cannot("a file of this name is there already; name another one, or remove it"));
    }
    let mut connection = connect(path).await?;
    let part = beside(to, ".part");
    remove(&part)?;
    // Made empty before: SQLite would not say which of the two files it cannot open.
    std::fs::File::create_new(&part).map_err(failed("no file can be created in its folder"))?;
    let report = copy(&mut connection, &part).await?;
    // Not renamed: that would replace a file that came meanwhile.
    std::fs::hard_link(&part, to).map_err(failed("the file cannot be given its name"))?;
    remove(&part)?;
    sync_folder(to)?;
    sqlx::Connection::close(connection).await?;
    Ok(report)
}
