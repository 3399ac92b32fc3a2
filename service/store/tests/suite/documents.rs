//! Machine profiles and tools.

use feedwave_store::{Kind, PageRequest, Store, StoreError, StoreSettings, ToolFilter};

use super::{Place, json, open};

#[tokio::test]
async fn machines_are_created_updated_deleted_by_etag() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.create_machine(Some("lathe-1"), json(r#"{"v":1}"#)).await.unwrap();
    assert_eq!((first.id.as_str(), first.body.get()), ("lathe-1", r#"{"v":1}"#));
    let taken = store.create_machine(Some("lathe-1"), json("{}")).await;
    assert!(matches!(taken, Err(StoreError::AlreadyExists { kind: Kind::Machine, .. })), "{taken:?}");
    let generated = store.create_machine(None, json("{}")).await.unwrap();
    assert_eq!(store.machine(&generated.id).await.unwrap().etag, generated.etag);

    let second = store.update_machine("lathe-1", Some(&first.etag), json(r#"{"v":2}"#)).await.unwrap();
    assert_ne!(second.etag, first.etag);
    assert_eq!(second.created_us, first.created_us);
    assert!(second.updated_us > first.updated_us);
    let stale = store.update_machine("lathe-1", Some(&first.etag), json(r#"{"v":3}"#)).await;
    assert!(matches!(&stale, Err(StoreError::EtagMismatch { current, .. }) if *current == second.etag), "{stale:?}");
    assert_eq!(store.machine("lathe-1").await.unwrap().body.get(), r#"{"v":2}"#);
    let third = store.update_machine("lathe-1", None, json(r#"{"v":3}"#)).await.unwrap();

    let stale = store.delete_machine("lathe-1", Some(&second.etag)).await;
    assert!(matches!(stale, Err(StoreError::EtagMismatch { .. })), "{stale:?}");
    store.delete_machine("lathe-1", Some(&third.etag)).await.unwrap();
    for absent in [
        store.machine("lathe-1").await.map(|_| ()),
        store.update_machine("lathe-1", None, json("{}")).await.map(|_| ()),
        store.delete_machine("lathe-1", None).await,
    ] {
        assert!(matches!(absent, Err(StoreError::NotFound { kind: Kind::Machine, .. })), "{absent:?}");
    }
    let anew = store.create_machine(Some("lathe-1"), json(r#"{"v":1}"#)).await.unwrap();
    assert_ne!(anew.etag, first.etag, "an old etag does not fit a new profile");
}

#[tokio::test]
async fn of_racing_updates_one_wins() {
    let place = Place::new();
    let store = open(&place).await;
    let first = store.create_machine(Some("m"), json("0")).await.unwrap();
    let mut updates = tokio::task::JoinSet::new();
    for value in 1..20 {
        let (store, etag) = (store.clone(), first.etag.clone());
        updates.spawn(async move { store.update_machine("m", Some(&etag), json(&value.to_string())).await });
    }
    let outcomes = updates.join_all().await;
    let won: Vec<_> = outcomes.iter().filter_map(|outcome| outcome.as_ref().ok()).collect();
    assert_eq!(won.len(), 1);
    assert_eq!(store.machine("m").await.unwrap().body.get(), won[0].body.get());
}

#[tokio::test]
async fn tools_are_found_by_number() {
    let place = Place::new();
    let store = open(&place).await;
    for index in 0..12_u32 {
        store.create_tool(Some(&format!("t-{index:02}")), index % 4, json(&format!("[{index}]"))).await.unwrap();
    }
    // A machine of the same name is another thing.
    store.create_machine(Some("t-00"), json("{}")).await.unwrap();
    store.delete_machine("t-00", None).await.unwrap();
    assert_eq!(store.tool("t-00").await.unwrap().number, 0);

    for (number, expected) in [(None, (0..12).collect::<Vec<_>>()), (Some(3), vec![3, 7, 11]), (Some(u32::MAX), vec![])]
    {
        let (mut ids, mut token) = (Vec::new(), String::new());
        loop {
            let page = store.list_tools(&ToolFilter { number }, &PageRequest { size: 2, token }).await.unwrap();
            assert!(page.items.iter().all(|tool| number.is_none_or(|number| tool.number == number)));
            ids.extend(page.items.into_iter().map(|tool| tool.id));
            match page.next_token {
                Some(next) => token = next,
                None => break,
            }
        }
        assert_eq!(ids, expected.iter().map(|index| format!("t-{index:02}")).collect::<Vec<_>>());
    }
    let page = store.list_tools(&ToolFilter { number: Some(1) }, &PageRequest { size: 1, token: String::new() }).await;
    let token = page.unwrap().next_token.unwrap();
    let other = store.list_tools(&ToolFilter { number: Some(2) }, &PageRequest { size: 1, token }).await;
    assert!(matches!(other, Err(StoreError::InvalidPageToken)), "a token does not fit other filters");

    let tool = store.tool("t-05").await.unwrap();
    let moved = store.update_tool("t-05", Some(&tool.etag), u32::MAX, json("{}")).await.unwrap();
    assert_eq!((moved.number, moved.body.get()), (u32::MAX, "{}"));
    store.delete_tool("t-05", Some(&moved.etag)).await.unwrap();
    assert!(matches!(store.tool("t-05").await, Err(StoreError::NotFound { kind: Kind::Tool, .. })));
}

#[tokio::test]
async fn documents_are_bounded() {
    let place = Place::new();
    let store = place.open(StoreSettings { max_document_bytes: 10, ..StoreSettings::default() }).await;
    let large = json(r#""0123456789""#);
    assert!(matches!(store.create_machine(None, large.clone()).await, Err(StoreError::TooLarge { .. })));
    assert!(matches!(store.create_tool(None, 1, large.clone()).await, Err(StoreError::TooLarge { .. })));
    assert!(matches!(store.create_tool(Some(&"x".repeat(257)), 1, json("1")).await, Err(StoreError::TooLarge { .. })));
    store.create_tool(Some("t"), 1, json("1")).await.unwrap();
    assert!(matches!(store.update_tool("t", None, 1, large).await, Err(StoreError::TooLarge { .. })));
}

/// Identifiers on each page of the machines, 500 asked for at a time.
async fn pages_of_machines(store: &Store) -> Vec<Vec<String>> {
    let (mut pages, mut token) = (Vec::new(), String::new());
    loop {
        let page = store.list_machines(&PageRequest { size: 500, token }).await.unwrap();
        pages.push(page.items.into_iter().map(|machine| machine.id).collect());
        match page.next_token {
            Some(next) => token = next,
            None => return pages,
        }
    }
}

#[tokio::test]
async fn a_page_of_large_documents_has_fewer() {
    let place = Place::new();
    let store = open(&place).await;
    // Of 2 MiB, the bound of a page: 0.75 MiB, 0.75 MiB, 1 MiB, more than a page alone, and two small ones.
    for (id, kibibytes) in [("a", 768), ("b", 768), ("c", 1024), ("d", 3072), ("e", 1), ("f", 1)] {
        store.create_machine(Some(id), json(&format!("\"{}\"", "x".repeat(kibibytes << 10)))).await.unwrap();
    }
    assert_eq!(pages_of_machines(&store).await, [vec!["a", "b"], vec!["c"], vec!["d"], vec!["e", "f"]]);
    // What is read of a page and not given is in nobody's way.
    assert_eq!(store.machine("f").await.unwrap().id, "f");
}
