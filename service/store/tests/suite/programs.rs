//! Programs put as a whole.

use feedwave_store::{
    CHUNK_BYTES, Kind, MAX_PUT_BYTES, NewJob, PageRequest, ProgramId, StoreError, StoreSettings, Tenant,
};

use super::{Place, new_job, open, read_back, source, with_program};

#[tokio::test]
async fn put_is_idempotent_and_addressed_by_content() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.put_program(Tenant::DEFAULT, "G0 X1\n".into()).await.unwrap();
    let again = store.put_program(Tenant::DEFAULT, "G0 X1\n".into()).await.unwrap();
    assert_eq!(first, again);
    assert_eq!(first.id, ProgramId::of(b"G0 X1\n"));
    assert_eq!((first.size_bytes, first.chunk_count), (6, 1));
    assert_eq!(store.program_info(first.id).await.unwrap(), first);
    assert_eq!(&store.program_chunk(first.id, 0).await.unwrap()[..], b"G0 X1\n");
}

#[tokio::test]
async fn concurrent_puts_store_one_program() {
    let place = Place::new();
    let store = open(&place).await;
    let mut puts = tokio::task::JoinSet::new();
    for _ in 0..16 {
        let store = store.clone();
        puts.spawn(async move { store.put_program(Tenant::DEFAULT, source(100_000).into()).await.unwrap() });
    }
    let infos = puts.join_all().await;
    assert!(infos.iter().all(|info| *info == infos[0]));
}

#[tokio::test]
async fn any_chunk_is_read_alone() {
    let place = Place::new();
    let store = open(&place).await;
    let chunk = CHUNK_BYTES as usize;
    for size in [0, 1, chunk - 1, chunk, chunk + 1, 3 * chunk + 17] {
        let source = source(size);
        let info = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap();
        assert_eq!(info.chunk_count, size.div_ceil(chunk) as u64, "{size} bytes");
        for (index, expected) in source.chunks(chunk).enumerate().rev() {
            assert_eq!(store.program_chunk(info.id, index as u64).await.unwrap(), expected, "chunk {index} of {size}");
        }
        assert_eq!(read_back(&store, info.id).await, source);
        for beyond in [info.chunk_count, u64::MAX] {
            let missing = store.program_chunk(info.id, beyond).await;
            assert!(matches!(missing, Err(StoreError::NotFound { kind: Kind::Program, .. })));
        }
    }
}

#[tokio::test]
async fn too_large_is_refused() {
    let place = Place::new();
    let store = place.open(StoreSettings { max_program_bytes: 10, ..StoreSettings::default() }).await;
    store.put_program(Tenant::DEFAULT, "0123456789".into()).await.unwrap();
    let refused = store.put_program(Tenant::DEFAULT, "0123456789A".into()).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { size: 11, limit: 10, .. })), "{refused:?}");
    drop(store);
    let store = open(&place).await;
    let refused = store.put_program(Tenant::DEFAULT, vec![b' '; MAX_PUT_BYTES as usize + 1].into()).await;
    assert!(matches!(refused, Err(StoreError::TooLarge { limit: MAX_PUT_BYTES, .. })), "{refused:?}");
}

#[tokio::test]
async fn a_referenced_program_stays() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job = store.create_job(new_job("r", program)).await.unwrap();
    let refused = store.delete_program(program).await;
    assert!(matches!(refused, Err(StoreError::InUse { users: 1, .. })), "{refused:?}");
    store.program_chunk(program, 0).await.unwrap();

    store.delete_job(job.id, None).await.unwrap();
    store.delete_program(program).await.unwrap();
    assert!(matches!(store.program_info(program).await, Err(StoreError::NotFound { .. })));
    assert!(matches!(store.delete_program(program).await, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn a_further_file_of_a_job_stays() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let sub = store.put_program(Tenant::DEFAULT, "O1000\nG0 X1\nM99\n".into()).await.unwrap().id;
    let absent = ProgramId::of(b"absent");
    let further = |ids: &[ProgramId]| NewJob { further_program_ids: ids.to_vec(), ..new_job("r", program) };
    let refused = store.create_job(further(&[sub, absent])).await;
    assert!(matches!(&refused, Err(StoreError::NotFound { id, .. }) if *id == absent.to_string()), "{refused:?}");
    let job = store.create_job(further(&[sub, program, sub])).await.unwrap();
    assert_eq!(store.program_entry(sub).await.unwrap().job_count, 1);
    assert_eq!(store.program_entry(program).await.unwrap().job_count, 1);
    let refused = store.delete_program(sub).await;
    assert!(matches!(refused, Err(StoreError::InUse { users: 1, .. })), "{refused:?}");
    store.delete_job(job.id, None).await.unwrap();
    store.delete_program(sub).await.unwrap();
}

#[tokio::test]
async fn programs_are_listed_by_name_and_page() {
    let place = Place::new();
    let store = open(&place).await;
    let mut ids = Vec::new();
    for index in 0..7 {
        let id = store.put_program(Tenant::DEFAULT, format!("G0 X{index}\nM30\n").into()).await.unwrap().id;
        store.name_program(id, if index % 2 == 0 { "even.nc" } else { "odd.nc" }).await.unwrap();
        ids.push(id);
    }
    let all = async |name: &str| {
        let (mut found, mut token) = (Vec::new(), String::new());
        loop {
            let page = store.list_programs(None, name, &PageRequest { size: 2, token }).await.unwrap();
            found.extend(page.items.into_iter().map(|entry| entry.info.id));
            match page.next_token {
                Some(next) => token = next,
                None => return found,
            }
        }
    };
    let mut listed = all("").await;
    assert_eq!((listed.len(), all("even.nc").await.len(), all("odd.nc").await.len()), (7, 4, 3));
    listed.sort_unstable();
    ids.sort_unstable();
    assert_eq!(listed, ids);
    assert!(all("none.nc").await.is_empty());
    let token = store.list_programs(None, "", &PageRequest { size: 2, token: String::new() }).await.unwrap().next_token;
    let elsewhere = store.list_programs(None, "odd.nc", &PageRequest { size: 2, token: token.unwrap() }).await;
    assert!(matches!(elsewhere, Err(StoreError::InvalidPageToken)));
    let unknown = store.name_program(ProgramId::of(b"absent"), "a.nc").await;
    assert!(matches!(unknown, Err(StoreError::NotFound { .. })));
}

#[tokio::test]
async fn a_deleted_program_can_be_put_again() {
    let place = Place::new();
    let store = open(&place).await;
    let source = source(5 * CHUNK_BYTES as usize);
    let info = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap();
    store.delete_program(info.id).await.unwrap();
    store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap();
    assert_eq!(read_back(&store, info.id).await, source);
}
