//! Compression of stored bytes, off the async threads where it takes long.

use bytes::Bytes;

use crate::error::{Result, StoreError};

/// zstd's own default: three times smaller G-code at some hundred MB/s.
const LEVEL: i32 = 3;

/// Below this many bytes the work is shorter than handing it to another thread.
const INLINE_BYTES: usize = 16 << 10;

/// Does `work` on `bytes` bytes where it does not hold up other tasks.
pub(crate) async fn offload<T, F>(bytes: usize, work: F) -> Result<T>
where
    T: Send + 'static,
    F: FnOnce() -> Result<T> + Send + 'static,
{
    if bytes <= INLINE_BYTES {
        return work();
    }
    let task = tokio::task::spawn_blocking(work);
    task.await.map_err(|_| StoreError::unavailable("the service is ending"))?
}

/// Compresses `source`. A checksum goes with it: damage must not come back as another program.
pub(crate) fn compress(source: &[u8]) -> Result<Vec<u8>> {
    let compress = || {
        let mut compressor = zstd::bulk::Compressor::new(LEVEL)?;
        compressor.include_checksum(true)?;
        compressor.compress(source)
    };
    compress().map_err(|error| StoreError::unavailable_by("compressing a record failed", error))
}

/// Restores the `size` bytes that were compressed.
pub(crate) fn decompress(data: &[u8], size: u64) -> Result<Bytes> {
    let capacity = usize::try_from(size).map_err(|_| StoreError::corrupt("a compressed record is too large"))?;
    let source = zstd::bulk::decompress(data, capacity)
        .map_err(|error| StoreError::corrupt_by("a compressed record cannot be restored", error))?;
    if source.len() != capacity {
        return Err(StoreError::corrupt("a compressed record has another size than when it was written"));
    }
    Ok(source.into())
}
