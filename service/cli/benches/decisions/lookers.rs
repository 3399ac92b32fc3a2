//! Those who look on: half of them have the page open (a stream of events each), half ask for all machines every second, as
//! dashboards do, with the entity tag of the answer before. They are a process of their own.

use std::time::Duration;

use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::{Instant, MissedTickBehavior, interval_at};

/// How often a poller asks.
const PERIOD: Duration = Duration::from_secs(1);

/// Looks on until the process is ended.
pub async fn look(address: &str, count: u64) {
    let mut all = JoinSet::new();
    for number in 0..count {
        let address = address.to_owned();
        // Not all at the same instant.
        let late = PERIOD.mul_f64(number as f64 / count as f64);
        if number % 2 == 0 {
            all.spawn(async move { page(&address).await.expect("a stream of events") });
        } else {
            all.spawn(async move { poll(&address, late).await.expect("answers") });
        }
    }
    while let Some(ended) = all.join_next().await {
        ended.expect("who looks on goes on");
    }
}

/// Follows the stream of events and reads what comes.
async fn page(address: &str) -> std::io::Result<()> {
    let mut stream = TcpStream::connect(address).await?;
    let request = format!("GET /v1/stream HTTP/1.1\r\nhost: {address}\r\naccept: text/event-stream\r\n\r\n");
    stream.write_all(request.as_bytes()).await?;
    let mut buffer = vec![0; 64 << 10];
    let mut is_first = true;
    loop {
        let read = stream.read(&mut buffer).await?;
        assert!(read > 0, "the stream ended");
        assert!(!is_first || buffer.starts_with(b"HTTP/1.1 200"), "{}", String::from_utf8_lossy(&buffer[..read]));
        is_first = false;
    }
}

/// Asks for all machines again and again.
async fn poll(address: &str, late: Duration) -> std::io::Result<()> {
    let mut stream = BufReader::new(TcpStream::connect(address).await?);
    let mut pace = interval_at(Instant::now() + late, PERIOD);
    pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut tag = String::new();
    loop {
        pace.tick().await;
        let known = if tag.is_empty() { String::new() } else { format!("if-none-match: {tag}\r\n") };
        let request = format!("GET /v1/machines HTTP/1.1\r\nhost: {address}\r\n{known}\r\n");
        stream.write_all(request.as_bytes()).await?;
        let (mut length, mut line) = (0, String::new());
        loop {
            line.clear();
            assert!(stream.read_line(&mut line).await? > 0, "the connection ended");
            let Some((name, value)) = line.trim_end().split_once(':') else {
                if line.trim_end().is_empty() {
                    break;
                }
                assert!(line.contains(" 200 ") || line.contains(" 304 "), "{line}");
                continue;
            };
            match name.to_ascii_lowercase().as_str() {
                "content-length" => length = value.trim().parse().expect("a length"),
                "etag" => value.trim().clone_into(&mut tag),
                _ => {}
            }
        }
        let mut body = vec![0; length];
        stream.read_exact(&mut body).await?;
    }
}
