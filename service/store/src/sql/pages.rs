//! Pages of lists, bounded in bytes.

use futures_util::{Stream, TryStreamExt};

use crate::error::Result;
use crate::page::{MAX_PAGE_BYTES, Page};

/// The page of the first `size` records, or of fewer where they have more than [`MAX_PAGE_BYTES`] together: a page has one
/// record at least, however large. Rows are read one after the other, so that no more than that is ever in memory.
pub(crate) async fn page_of<R, T>(
    mut rows: impl Stream<Item = sqlx::Result<R>> + Unpin,
    size: usize,
    record: impl Fn(&R) -> Result<T>,
    bytes: impl Fn(&T) -> usize,
    token: impl FnOnce(&T) -> String,
) -> Result<Page<T>> {
    let (mut items, mut total_bytes) = (Vec::new(), 0);
    while let Some(row) = rows.try_next().await? {
        let item = record(&row)?;
        total_bytes += bytes(&item);
        if items.len() == size || (total_bytes > MAX_PAGE_BYTES && !items.is_empty()) {
            let next_token = items.last().map(token);
            return Ok(Page { items, next_token });
        }
        items.push(item);
    }
    Ok(Page { items, next_token: None })
}
