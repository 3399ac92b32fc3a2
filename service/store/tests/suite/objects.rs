//! Large programs in an object store, here a folder.

use std::path::Path;

use bytes::Bytes;
use feedwave_store::{
    CHUNK_BYTES, ObjectSettings, ProgramId, Store, StoreError, StoreSettings, Tenant, UploadId, UploadStart,
};
use tempfile::TempDir;

use super::{Place, new_job, read_back, source};

const CHUNK: usize = CHUNK_BYTES as usize;

/// Programs of more than a chunk are objects in a folder.
pub(crate) fn settings(folder: &Path) -> StoreSettings {
    let uri = format!("file://{}", folder.display()).parse().expect("the URI of a folder");
    StoreSettings { objects: Some(ObjectSettings { uri, above_bytes: CHUNK_BYTES }), ..StoreSettings::default() }
}

/// The objects in a folder, but for parts of what is being written and the one that is there before any other.
pub(crate) fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let files = std::fs::read_dir(folder).expect("the folder is there").map(|file| {
        let file = file.expect("a file");
        (file.file_name().into_string().expect("text"), std::fs::read(file.path()).expect("can be read"))
    });
    files.filter(|(name, _)| !name.contains('#') && name != "feedwave").collect()
}

/// Uploads everything of a program but its end.
async fn begin(store: &Store, source: &[u8], tenant: Tenant) -> UploadId {
    let expected = ProgramId::of(source).of_tenant(tenant);
    let UploadStart::Unfinished(upload) = store.begin_upload(expected, source.len() as u64, "").await.unwrap() else {
        panic!("it is stored already")
    };
    store.append_upload(upload.id, 0, Bytes::copy_from_slice(source)).await.unwrap();
    upload.id
}

#[tokio::test]
async fn a_program_above_the_size_is_an_object_and_reads_as_any_other() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(settings(folder.path())).await;
    let small = source(CHUNK);
    let small = store.put_program(Tenant::DEFAULT, small.into()).await.unwrap();
    assert!(files(folder.path()).is_empty(), "it is not above the size");
    // By one call, and by pieces in several parts of the object store.
    let whole = source(2 * CHUNK + 7);
    let put = store.put_program(Tenant::DEFAULT, whole.clone().into()).await.unwrap();
    assert_eq!(read_back(&store, put.id).await, whole);
    let large: Vec<u8> = (0..40 * CHUNK as u64 / 8)
        .flat_map(|n| (n.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ n << 7).to_le_bytes())
        .collect();
    let upload = begin(&store, &large, Tenant::DEFAULT).await;
    let uploaded = store.finish_upload(upload).await.unwrap();
    assert_eq!((uploaded.size_bytes, uploaded.chunk_count), (large.len() as u64, 40));
    assert!(read_back(&store, uploaded.id).await == large);
    assert_eq!(&store.program_chunk(uploaded.id, 33).await.unwrap()[..], &large[33 * CHUNK..34 * CHUNK]);
    let beyond = store.program_chunk(uploaded.id, 40).await;
    assert!(matches!(beyond, Err(StoreError::NotFound { .. })), "{beyond:?}");
    let objects = files(folder.path());
    assert_eq!(objects.len(), 2);
    assert!(
        objects.iter().all(|(name, _)| !put.id.to_string().contains(name) && !uploaded.id.to_string().contains(name))
    );
    let report = feedwave_store::check(store.uri()).await.unwrap();
    assert!(report.is_intact(), "{report:?}");

    // Whatever the setting says, what is there is read and removed where it is.
    store.close().await;
    drop(store);
    let store = place.open(StoreSettings::default()).await;
    assert_eq!(read_back(&store, put.id).await, whole);
    let job = store.create_job(new_job("a", put.id)).await.unwrap().id;
    assert!(matches!(store.delete_program(put.id).await, Err(StoreError::InUse { .. })));
    assert_eq!(files(folder.path()).len(), 2);
    store.delete_job(job, None).await.unwrap();
    for id in [put.id, uploaded.id, small.id] {
        store.delete_program(id).await.unwrap();
        assert!(matches!(store.program_chunk(id, 0).await, Err(StoreError::NotFound { .. })));
    }
    assert!(files(folder.path()).is_empty());
}

#[tokio::test]
async fn equal_programs_of_two_tenants_are_two_objects() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(settings(folder.path())).await;
    let source = source(CHUNK + 1);
    let other: Tenant = "plant-b".parse().unwrap();
    let first = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap().id;
    let upload = begin(&store, &source, other).await;
    let second = store.finish_upload(upload).await.unwrap().id;
    assert_eq!(files(folder.path()).len(), 2);
    // Neither reads nor deletes the other's, nor learns that there is one.
    let third: Tenant = "plant-c".parse().unwrap();
    let none = ProgramId::of(&source).of_tenant(third);
    assert!(matches!(store.program_chunk(none, 0).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.delete_program(none).await, Err(StoreError::NotFound { .. })));
    store.delete_program(first).await.unwrap();
    assert!(matches!(store.program_chunk(first, 0).await, Err(StoreError::NotFound { .. })));
    assert_eq!(read_back(&store, second).await, source);
    // Once more is the same program, and no further object.
    store.put_program(other, source.clone().into()).await.unwrap();
    assert_eq!(files(folder.path()).len(), 1);
}

#[tokio::test]
async fn what_happens_to_an_object_is_found_and_said() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(settings(folder.path())).await;
    let source = source(3 * CHUNK);
    let id = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap().id;
    let (name, whole) = files(folder.path()).remove(0);
    let path = folder.path().join(&name);
    let mut changed = whole.clone();
    changed[whole.len() / 2] ^= 1;
    for (content, says) in [(&changed[..], "other bytes"), (&whole[..whole.len() / 2], "shorter")] {
        std::fs::write(&path, content).unwrap();
        let mut found = Vec::new();
        for index in 0..3 {
            if let Err(error) = store.program_chunk(id, index).await {
                assert!(matches!(error, StoreError::Corrupt { .. }), "{error:?}");
                found.push(error.to_string());
            }
        }
        assert!(!found.is_empty() && found.iter().all(|error| error.contains(says)), "{found:?}");
        let report = feedwave_store::check(store.uri()).await.unwrap();
        assert!(report.problems.len() == 1 && report.problems[0].reason.contains(says), "{report:?}");
    }
    std::fs::remove_file(&path).unwrap();
    let error = store.program_chunk(id, 0).await.unwrap_err();
    assert!(matches!(error, StoreError::Corrupt { .. }) && error.to_string().contains("is not there"), "{error:?}");
    let report = feedwave_store::check(store.uri()).await.unwrap();
    assert!(report.problems.len() == 1 && report.problems[0].reason.contains("is not there"), "{report:?}");
    // What is gone already can be deleted.
    store.delete_program(id).await.unwrap();
    assert!(feedwave_store::check(store.uri()).await.unwrap().is_intact());
}

#[tokio::test]
async fn a_folder_where_nothing_is_mounted_has_lost_nothing_and_is_written_nothing() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let (there, away) = (folder.path().join("objects"), folder.path().join("away"));
    std::fs::create_dir(&there).unwrap();
    let store = place.open(settings(&there)).await;
    let source = source(2 * CHUNK);
    let id = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap().id;
    let deleted = store.put_program(Tenant::DEFAULT, source[1..].to_vec().into()).await.unwrap().id;
    std::fs::rename(&there, &away).unwrap();
    std::fs::create_dir(&there).unwrap();
    let unread = store.program_chunk(id, 0).await.unwrap_err();
    assert!(matches!(unread, StoreError::Unavailable { .. }), "{unread:?}");
    let unwritten = store.put_program(Tenant::DEFAULT, source[2..].to_vec().into()).await.unwrap_err();
    assert!(matches!(unwritten, StoreError::Unavailable { .. }), "{unwritten:?}");
    store.delete_program(deleted).await.unwrap();
    store.expire_uploads().await.unwrap();
    assert_eq!(std::fs::read_dir(&there).unwrap().count(), 0);

    std::fs::remove_dir(&there).unwrap();
    std::fs::rename(&away, &there).unwrap();
    assert_eq!(read_back(&store, id).await, source);
    // What was deleted meanwhile goes now.
    store.expire_uploads().await.unwrap();
    assert_eq!(files(&there).len(), 1);
}

#[tokio::test]
async fn without_its_object_store_the_rest_goes_on_and_nothing_is_lost() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let there = folder.path().join("objects");
    let store = place.open(settings(&there)).await;
    let source = source(2 * CHUNK);
    let id = ProgramId::of(&source);
    let upload = begin(&store, &source, Tenant::DEFAULT).await;
    // The folder is not there.
    for _ in 0..2 {
        let refused = store.finish_upload(upload).await;
        assert!(matches!(refused, Err(StoreError::Unavailable { .. })), "{refused:?}");
    }
    store.ping().await.unwrap();
    store.expire_uploads().await.unwrap();
    let small = store.put_program(Tenant::DEFAULT, "M30\n".into()).await.unwrap().id;
    assert_eq!(read_back(&store, small).await, b"M30\n");
    assert_eq!(store.upload(upload).await.unwrap().received_bytes, source.len() as u64);

    std::fs::create_dir(&there).unwrap();
    assert_eq!(store.finish_upload(upload).await.unwrap().id, id);
    assert_eq!(read_back(&store, id).await, source);
    store.expire_uploads().await.unwrap();
    assert_eq!(files(&there).len(), 1);
}

#[tokio::test]
async fn an_upload_that_is_finished_twice_at_once_is_one_program_and_one_object() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(settings(folder.path())).await;
    let source = source(3 * CHUNK);
    let upload = begin(&store, &source, Tenant::DEFAULT).await;
    let (first, second) = tokio::join!(store.finish_upload(upload), store.finish_upload(upload));
    let finished: Vec<_> = [first, second].into_iter().filter_map(Result::ok).collect();
    assert!(!finished.is_empty());
    assert_eq!(read_back(&store, finished[0].id).await, source);
    store.expire_uploads().await.unwrap();
    assert_eq!(files(folder.path()).len(), 1);
}

#[tokio::test]
async fn a_program_with_another_hash_becomes_no_object() {
    let (place, folder) = (Place::new(), TempDir::new().unwrap());
    let store = place.open(settings(folder.path())).await;
    let source = source(2 * CHUNK);
    let expected = ProgramId::of(b"another");
    let UploadStart::Unfinished(upload) = store.begin_upload(expected, source.len() as u64, "").await.unwrap() else {
        panic!("it is stored already")
    };
    store.append_upload(upload.id, 0, source.into()).await.unwrap();
    let refused = store.finish_upload(upload.id).await;
    assert!(matches!(refused, Err(StoreError::HashMismatch { .. })), "{refused:?}");
    assert!(files(folder.path()).is_empty());
}
