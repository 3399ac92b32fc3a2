//! Checkpoints.

use feedwave_store::{Checkpoint, CheckpointSet, Kind, Store, StoreError, StoreSettings};
use uuid::Uuid;

use super::{Place, new_job, with_program};

fn checkpoint(setpoint_index: u64) -> Checkpoint {
    Checkpoint {
        setpoint_index,
        input_offset: setpoint_index * 3,
        snapshot: setpoint_index.to_le_bytes().to_vec().into(),
    }
}

async fn nearest(store: &Store, set: &CheckpointSet, index: u64) -> Option<u64> {
    let found = store.nearest_checkpoint(set, index).await.unwrap()?;
    assert_eq!(found, checkpoint(found.setpoint_index), "it comes back as it was put");
    Some(found.setpoint_index)
}

#[tokio::test]
async fn the_nearest_before_is_found() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job_id = store.create_job(new_job("r", program)).await.unwrap().id;
    let set = CheckpointSet { job_id, interpolation_period_us: 1000, generation_key: "v1".into() };
    assert_eq!(nearest(&store, &set, 0).await, None);
    store.put_checkpoints(&set, Vec::new()).await.unwrap();
    // More than one statement's worth.
    store.put_checkpoints(&set, (1..=2500).map(|step| checkpoint(step * 4096)).collect()).await.unwrap();
    for (wanted, expected) in [
        (0, None),
        (4095, None),
        (4096, Some(4096)),
        (8191, Some(4096)),
        (8192, Some(8192)),
        (u64::MAX, Some(2500 * 4096)),
    ] {
        assert_eq!(nearest(&store, &set, wanted).await, expected, "at {wanted}");
    }
    for other in [
        CheckpointSet { interpolation_period_us: 500, ..set.clone() },
        CheckpointSet { generation_key: "v2".into(), ..set.clone() },
        CheckpointSet { job_id: Uuid::now_v7(), ..set.clone() },
    ] {
        assert_eq!(nearest(&store, &other, u64::MAX).await, None, "{other:?}");
    }
}

#[tokio::test]
async fn sets_are_replaced_and_deleted_whole() {
    let place = Place::new();
    let (store, program) = with_program(&place).await;
    let job_id = store.create_job(new_job("r", program)).await.unwrap().id;
    let set = CheckpointSet { job_id, interpolation_period_us: 1000, generation_key: "v1".into() };
    let other = CheckpointSet { interpolation_period_us: 500, ..set.clone() };
    store.put_checkpoints(&set, vec![checkpoint(1), checkpoint(2)]).await.unwrap();
    store.put_checkpoints(&set, vec![checkpoint(2), checkpoint(3)]).await.unwrap();
    store.put_checkpoints(&other, vec![checkpoint(9)]).await.unwrap();
    assert_eq!(nearest(&store, &set, 1).await, Some(1));
    assert_eq!(nearest(&store, &set, 100).await, Some(3));
    store.replace_checkpoints(&set, vec![checkpoint(2)]).await.unwrap();
    assert_eq!(nearest(&store, &set, 1).await, None);
    assert_eq!(nearest(&store, &set, 100).await, Some(2));
    assert_eq!(nearest(&store, &other, 100).await, Some(9), "another set is untouched");
    store.delete_checkpoints(job_id).await.unwrap();
    assert_eq!(nearest(&store, &other, 100).await, None);

    store.put_checkpoints(&set, vec![checkpoint(1)]).await.unwrap();
    store.delete_job(job_id, None).await.unwrap();
    assert_eq!(nearest(&store, &set, 100).await, None, "they go with their job");
    let refused = store.put_checkpoints(&set, vec![checkpoint(1)]).await;
    assert!(matches!(refused, Err(StoreError::NotFound { kind: Kind::Job, .. })), "{refused:?}");
}

#[tokio::test]
async fn bounds_are_kept() {
    let place = Place::new();
    let (_, program) = with_program(&place).await;
    let store = place.open(StoreSettings { max_snapshot_bytes: 8, ..StoreSettings::default() }).await;
    let job_id = store.create_job(new_job("r", program)).await.unwrap().id;
    let set = CheckpointSet { job_id, interpolation_period_us: 1000, generation_key: "v1".into() };
    let large = Checkpoint { snapshot: vec![0; 9].into(), ..checkpoint(2) };
    let beyond = Checkpoint { setpoint_index: u64::MAX, ..checkpoint(0) };
    for refused in [large, beyond] {
        let refused = store.replace_checkpoints(&set, vec![checkpoint(1), refused]).await;
        assert!(matches!(refused, Err(StoreError::TooLarge { .. })), "{refused:?}");
    }
    assert_eq!(nearest(&store, &set, u64::MAX).await, None, "all or none");
}
