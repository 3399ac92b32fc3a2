//! Pages of lists, bounded in bytes.

use futures_util::{Stream, TryStreamExt};

use super::record::Record;
use crate::error::{Result, StoreError};
use crate::page::{MAX_PAGE_BYTES, Page, Scope};

/// The page of the first `size` records, or of fewer where they have more than [`MAX_PAGE_BYTES`] together: a page has one
/// record at least, however large. Rows are read one after the other, so that no more than that is ever in memory. Those that
/// are damaged count, and are named beside the others.
pub(crate) async fn page_of<R: Record, T>(
    mut rows: impl Stream<Item = sqlx::Result<R>> + Unpin,
    size: usize,
    record: impl Fn(&R) -> Result<T>,
    bytes: impl Fn(&T) -> usize,
    token: impl FnOnce(&R) -> Result<String>,
) -> Result<Page<T>> {
    let (mut items, mut unreachable, mut total_bytes) = (Vec::new(), Vec::new(), 0);
    let mut last = None;
    while let Some(row) = rows.try_next().await? {
        if let Some(last) = last.as_ref().filter(|_| items.len() + unreachable.len() == size) {
            return Ok(Page { items, next_token: Some(token(last)?), unreachable });
        }
        match record(&row) {
            Ok(item) => {
                total_bytes += bytes(&item);
                if let Some(last) = last.as_ref().filter(|_| total_bytes > MAX_PAGE_BYTES && !items.is_empty()) {
                    return Ok(Page { items, next_token: Some(token(last)?), unreachable });
                }
                items.push(item);
            }
            Err(StoreError::Corrupt { reason, .. }) => {
                let id = row.text("id")?;
                // The key of a program has the tenant behind it.
                let id = id.split_once(' ').map_or(id, |(id, _)| id);
                tracing::error!(id, reason, "a record is damaged, and is left out of a list");
                unreachable.push(id.to_owned());
            }
            Err(error) => return Err(error),
        }
        last = Some(row);
    }
    Ok(Page { items, next_token: None, unreachable })
}

/// Makes the token of a list that goes by `sequence`, from the last row of a page.
pub(crate) fn sequence_token<R: Record>(scope: &Scope) -> impl FnOnce(&R) -> Result<String> + Send + '_ {
    move |last| Ok(scope.sequence_token(last.integer("sequence")?))
}

/// Makes the token of a list that goes by `id`.
pub(crate) fn id_token<R: Record>(scope: &Scope) -> impl FnOnce(&R) -> Result<String> + Send + '_ {
    move |last| Ok(scope.token(last.text("id")?.as_bytes()))
}
