//! Programs in an object store that speaks the protocol of S3, and answers late, wrongly or not at all.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use feedwave_store::{
    CHUNK_BYTES, CopyError, ObjectSettings, ProgramId, Store, StoreError, StoreSettings, StoreUri, Tenant, UploadStart,
};
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, SqliteConnection};
use tempfile::TempDir;

const CHUNK: usize = CHUNK_BYTES as usize;

/// How it answers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Mood {
    #[default]
    Good,
    /// A tenth of a second late.
    Slow,
    /// Never.
    Silent,
    /// With this status.
    Refuses(u16),
    /// The whole object, whatever range is asked for.
    IgnoresRanges,
    /// Fails once, then is good.
    FailsOnce,
}

#[derive(Debug, Default)]
struct Fake {
    mood: Mood,
    objects: BTreeMap<String, Bytes>,
    /// The object that is there before any other.
    mark: Option<String>,
    parts: BTreeMap<String, Vec<Bytes>>,
    /// Lengths of what was read.
    read: Vec<usize>,
    asked: usize,
}

type Shared = Arc<Mutex<Fake>>;

fn set(fake: &Shared, mood: Mood) {
    fake.lock().unwrap().mood = mood;
}

fn xml(body: String) -> Response {
    ([(header::CONTENT_TYPE, "application/xml")], body).into_response()
}

async fn answer(State(fake): State<Shared>, request: Request) -> Response {
    let (parts, body) = request.into_parts();
    let body = axum::body::to_bytes(body, 64 << 20).await.expect("a body");
    let mood = {
        let mut fake = fake.lock().unwrap();
        fake.asked += 1;
        let mood = fake.mood;
        if mood == Mood::FailsOnce {
            fake.mood = Mood::Good;
        }
        mood
    };
    match mood {
        Mood::Slow => tokio::time::sleep(Duration::from_millis(100)).await,
        Mood::Silent => std::future::pending().await,
        Mood::Refuses(status) => return StatusCode::from_u16(status).expect("a status").into_response(),
        Mood::FailsOnce => return StatusCode::SERVICE_UNAVAILABLE.into_response(),
        Mood::Good | Mood::IgnoresRanges => {}
    }
    served(&fake, &parts.method, &parts.uri, &parts.headers, body, mood)
}

// As long as the requests that an object store is sent: an arm for each.
fn served(fake: &Shared, method: &Method, uri: &Uri, headers: &HeaderMap, body: Bytes, mood: Mood) -> Response {
    let mut fake = fake.lock().unwrap();
    let key = uri.path().to_owned();
    let query = uri.query().unwrap_or_default().to_owned();
    let tag = [(header::ETAG, HeaderValue::from_static("\"tag\""))];
    match (method.as_str(), query.as_str()) {
        ("POST", "uploads=" | "uploads") => {
            fake.parts.insert(key.clone(), Vec::new());
            xml("<InitiateMultipartUploadResult><UploadId>1</UploadId></InitiateMultipartUploadResult>".into())
        }
        ("PUT", query) if query.contains("partNumber") => {
            fake.parts.entry(key).or_default().push(body);
            tag.into_response()
        }
        ("POST", "delete=" | "delete") => {
            let body = String::from_utf8(body.to_vec()).expect("text");
            let keys: Vec<&str> = body.split("<Key>").skip(1).filter_map(|rest| rest.split("</Key>").next()).collect();
            let mut deleted = String::new();
            for name in keys {
                fake.objects.remove(&format!("{}/{name}", key.trim_end_matches('/')));
                deleted += &format!("<Deleted><Key>{name}</Key></Deleted>");
            }
            xml(format!("<DeleteResult>{deleted}</DeleteResult>"))
        }
        ("POST", _) => {
            let whole = fake.parts.remove(&key).unwrap_or_default().concat();
            fake.objects.insert(key, whole.into());
            xml("<CompleteMultipartUploadResult><ETag>\"tag\"</ETag></CompleteMultipartUploadResult>".into())
        }
        ("PUT", _) if key.ends_with("/feedwave") => {
            assert!(fake.objects.is_empty() && body.is_empty());
            fake.mark = Some(key);
            tag.into_response()
        }
        ("PUT", _) => {
            fake.objects.insert(key, body);
            tag.into_response()
        }
        ("DELETE", query) if query.contains("uploadId") => {
            fake.parts.remove(&key);
            StatusCode::NO_CONTENT.into_response()
        }
        ("DELETE", _) => {
            fake.objects.remove(&key);
            StatusCode::NO_CONTENT.into_response()
        }
        (method, _) => {
            let mark = (fake.mark.as_ref() == Some(&key)).then(Bytes::new);
            let Some(object) = fake.objects.get(&key).cloned().or(mark) else {
                return StatusCode::NOT_FOUND.into_response();
            };
            let modified = [(header::LAST_MODIFIED, HeaderValue::from_static("Thu, 01 Jan 2026 00:00:00 GMT"))];
            let range = headers.get(header::RANGE).and_then(|range| range.to_str().ok()?.strip_prefix("bytes="));
            let range = range.and_then(|range| range.split_once('-'));
            let (Some((begin, end)), "GET") = (range, method) else {
                return (tag, modified, object).into_response();
            };
            if mood == Mood::IgnoresRanges {
                return (tag, modified, object).into_response();
            }
            let (begin, end): (usize, usize) = (begin.parse().expect("a number"), end.parse().expect("a number"));
            if begin >= object.len() {
                return StatusCode::RANGE_NOT_SATISFIABLE.into_response();
            }
            let end = (end + 1).min(object.len());
            fake.read.push(end - begin);
            let said = format!("bytes {begin}-{}/{}", end - 1, object.len());
            let said = [(header::CONTENT_RANGE, said)];
            (StatusCode::PARTIAL_CONTENT, tag, modified, said, object.slice(begin..end)).into_response()
        }
    }
}

/// It, and the store that uses it, which waits for an answer for so long.
async fn opened(folder: &TempDir) -> (Shared, Store) {
    opened_within(folder, "60s").await
}

async fn opened_within(folder: &TempDir, timeout: &str) -> (Shared, Store) {
    let fake = Shared::default();
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let service = Router::new().fallback(answer).with_state(fake.clone());
    tokio::spawn(async move { axum::serve(listener, service).await });
    let uri = format!(
        "s3://bucket/pre/fix?endpoint=http://{address}&allow_http=true&region=plant&skip_signature=true&timeout={timeout}"
    );
    let objects = ObjectSettings { uri: uri.parse().unwrap(), above_bytes: CHUNK_BYTES };
    let place = StoreUri::of_file(&folder.path().join("feedwave.db")).unwrap();
    let settings = StoreSettings { objects: Some(objects), ..StoreSettings::default() };
    (fake, Store::open(&place, settings).await.unwrap())
}

/// Bytes that hardly compress.
fn noise(bytes: usize) -> Vec<u8> {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    (0..bytes.div_ceil(8)).flat_map(|_| next().to_le_bytes()).take(bytes).collect()
}

#[tokio::test]
async fn a_large_program_is_written_in_parts_and_read_by_ranges() {
    let folder = TempDir::new().unwrap();
    let (fake, store) = opened(&folder).await;
    let source = noise(35 * CHUNK + 5);
    let id = ProgramId::of(&source);
    let UploadStart::Unfinished(upload) = store.begin_upload(id, source.len() as u64, "").await.unwrap() else {
        panic!("it is stored already")
    };
    store.append_upload(upload.id, 0, source.clone().into()).await.unwrap();
    set(&fake, Mood::Slow);
    store.finish_upload(upload.id).await.unwrap();
    {
        let fake = fake.lock().unwrap();
        assert_eq!((fake.objects.len(), fake.parts.len()), (1, 0));
        let (key, object) = fake.objects.first_key_value().unwrap();
        assert!(key.starts_with("/bucket/pre/fix/") && !key.contains(&id.to_string()), "{key}");
        assert!(object.len() > 32 << 20, "it took more than two parts");
    }
    for index in [34, 0, 35] {
        let chunk = store.program_chunk(id, index).await.unwrap();
        assert!(chunk[..] == source[index as usize * CHUNK..source.len().min((index as usize + 1) * CHUNK)]);
    }
    let read = fake.lock().unwrap().read.clone();
    assert!(read.len() == 3 && read.iter().all(|bytes| *bytes < 2 * CHUNK), "{read:?}");
    assert!(feedwave_store::check(store.uri()).await.unwrap().is_intact());
    store.delete_program(id).await.unwrap();
    assert!(fake.lock().unwrap().objects.is_empty());
}

async fn refuses_to_write(mood: Mood) {
    let folder = TempDir::new().unwrap();
    let (fake, store) = opened_within(&folder, "300ms").await;
    let source = noise(2 * CHUNK);
    let id = ProgramId::of(&source);
    set(&fake, mood);
    let refused = store.put_program(Tenant::DEFAULT, source.clone().into()).await;
    assert!(matches!(refused, Err(StoreError::Unavailable { .. })), "{mood:?}: {refused:?}");
    assert!(matches!(store.program_info(id).await, Err(StoreError::NotFound { .. })));
    store.ping().await.unwrap();
}

async fn refuses_to_read(mood: Mood) {
    let folder = TempDir::new().unwrap();
    let (fake, mut store) = opened(&folder).await;
    let source = noise(2 * CHUNK);
    let id = store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap().id;
    if mood == Mood::Silent {
        // Written with patience, read with less.
        let uri = store.uri().clone();
        store.close().await;
        drop(store);
        let file = SqliteConnectOptions::new().filename(folder.path().join("feedwave.db"));
        let mut database = SqliteConnection::connect_with(&file).await.unwrap();
        let hasty = "UPDATE objects SET place = REPLACE(place, 'timeout=60s', 'timeout=300ms')";
        assert_eq!(sqlx::query(hasty).execute(&mut database).await.unwrap().rows_affected(), 1);
        database.close().await.unwrap();
        store = Store::open(&uri, StoreSettings::default()).await.unwrap();
    }
    set(&fake, mood);
    let refused = store.program_chunk(id, 1).await;
    assert!(matches!(refused, Err(StoreError::Unavailable { .. })), "{mood:?}: {refused:?}");
}

#[tokio::test]
async fn one_that_refuses_or_says_nothing_is_unavailable() {
    tokio::join!(
        refuses_to_write(Mood::Refuses(503)),
        refuses_to_write(Mood::Refuses(403)),
        refuses_to_write(Mood::Refuses(404)),
        refuses_to_write(Mood::Silent),
        refuses_to_read(Mood::Refuses(503)),
        refuses_to_read(Mood::Refuses(403)),
        refuses_to_read(Mood::Silent),
        refuses_to_read(Mood::IgnoresRanges),
    );
}

#[tokio::test]
async fn one_that_fails_now_and_then_loses_nothing() {
    let folder = TempDir::new().unwrap();
    let (fake, store) = opened(&folder).await;
    let source = noise(2 * CHUNK);
    let id = ProgramId::of(&source);
    set(&fake, Mood::FailsOnce);
    store.put_program(Tenant::DEFAULT, source.clone().into()).await.unwrap();
    set(&fake, Mood::FailsOnce);
    assert!(store.program_chunk(id, 1).await.unwrap()[..] == source[CHUNK..]);

    // Deleted is deleted; the object goes later.
    set(&fake, Mood::Refuses(403));
    store.delete_program(id).await.unwrap();
    assert!(matches!(store.program_chunk(id, 1).await, Err(StoreError::NotFound { .. })));
    store.expire_uploads().await.unwrap();
    set(&fake, Mood::Good);
    assert_eq!(fake.lock().unwrap().objects.len(), 1);
    store.expire_uploads().await.unwrap();
    assert!(fake.lock().unwrap().objects.is_empty());
    let asked = fake.lock().unwrap().asked;
    store.expire_uploads().await.unwrap();
    assert_eq!(fake.lock().unwrap().asked, asked, "nothing is left to remove");
}

#[tokio::test]
async fn what_cannot_be_verified_is_no_intact_program() {
    let folder = TempDir::new().unwrap();
    let (fake, store) = opened(&folder).await;
    for seed in 0..3_usize {
        store.put_program(Tenant::DEFAULT, noise(2 * CHUNK + seed).into()).await.unwrap();
    }
    set(&fake, Mood::Refuses(403));
    let asked = fake.lock().unwrap().asked;
    let report = feedwave_store::check(store.uri()).await.unwrap();
    assert_eq!(report.problems.len(), 3);
    assert!(report.problems.iter().all(|problem| problem.reason.contains("refuses the credentials")), "{report:?}");
    assert!(fake.lock().unwrap().asked - asked < 10, "it is not asked for each");
    let copy = folder.path().join("copy.db");
    let copied = feedwave_store::backup(store.uri(), &copy).await.unwrap();
    assert_eq!((copied.programs, copied.programs_in_objects), (3, 3));
    let elsewhere = StoreUri::of_file(&folder.path().join("restored.db")).unwrap();
    let refused = feedwave_store::restore(&elsewhere, &copy, false).await;
    assert!(matches!(refused, Err(CopyError::From(StoreError::Damaged { count: 3, .. }))), "{refused:?}");
    set(&fake, Mood::Good);
    assert_eq!(feedwave_store::restore(&elsewhere, &copy, false).await.unwrap().programs_in_objects, 3);
}

#[tokio::test]
async fn deleting_waits_once_for_one_that_removes_nothing() {
    let folder = TempDir::new().unwrap();
    let (fake, store) = opened(&folder).await;
    let mut ids = Vec::new();
    for seed in 0..3_usize {
        ids.push(store.put_program(Tenant::DEFAULT, noise(CHUNK + 1 + seed).into()).await.unwrap().id);
    }
    set(&fake, Mood::Refuses(403));
    let asked = fake.lock().unwrap().asked;
    for id in ids {
        store.delete_program(id).await.unwrap();
        assert!(matches!(store.program_chunk(id, 0).await, Err(StoreError::NotFound { .. })));
    }
    assert_eq!(fake.lock().unwrap().asked - asked, 1);
    set(&fake, Mood::Good);
    store.expire_uploads().await.unwrap();
    assert!(fake.lock().unwrap().objects.is_empty());
}
