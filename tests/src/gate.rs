//! Plain TCP in between: a balancer, or a wire that can be cut.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::task::JoinHandle;

/// Hands each connection on to one of several addresses in turn, the next where nobody listens. It knows nothing of what
/// is said.
#[derive(Debug)]
pub struct Gate {
    /// Where it listens.
    pub address: SocketAddr,
    targets: watch::Sender<Vec<SocketAddr>>,
    cut: watch::Sender<bool>,
    breaks: watch::Sender<u64>,
    listening: JoinHandle<()>,
}

impl Gate {
    /// A gate before these addresses.
    ///
    /// # Panics
    /// When no port can be had.
    pub async fn new(targets: Vec<SocketAddr>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("an address");
        let (targets, now) = watch::channel(targets);
        let (cut, is_cut) = watch::channel(false);
        let (breaks, broken) = watch::channel(0);
        let listening = tokio::spawn(async move {
            let turn = Arc::new(AtomicUsize::new(0));
            while let Ok((client, _)) = listener.accept().await {
                let (mut broken, connection) =
                    (broken.clone(), hand_on(client, now.clone(), is_cut.clone(), turn.clone()));
                broken.mark_unchanged();
                tokio::spawn(async move {
                    tokio::select! {
                        () = connection => {}
                        _ = broken.changed() => {}
                    }
                });
            }
        });
        Self { address, targets, cut, breaks, listening }
    }

    /// Where new connections go from now on.
    pub fn set_targets(&self, targets: Vec<SocketAddr>) {
        self.targets.send_replace(targets);
    }

    /// Ends all connections, wherever in a message they are.
    pub fn break_off(&self) {
        self.breaks.send_modify(|breaks| *breaks += 1);
    }

    /// Cuts the wire or mends it: while it is cut, nothing arrives on either side, and nobody is told. What was sent
    /// meanwhile arrives late.
    pub fn cut(&self, cut: bool) {
        self.cut.send_replace(cut);
    }
}

impl Drop for Gate {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

async fn hand_on(
    client: TcpStream,
    targets: watch::Receiver<Vec<SocketAddr>>,
    mut cut: watch::Receiver<bool>,
    turn: Arc<AtomicUsize>,
) {
    if cut.wait_for(|cut| !cut).await.is_err() {
        return;
    }
    let targets = targets.borrow().clone();
    for _ in 0..targets.len() {
        let target = targets[turn.fetch_add(1, Ordering::Relaxed) % targets.len()];
        if let Ok(server) = TcpStream::connect(target).await {
            let _ = (client.set_nodelay(true), server.set_nodelay(true));
            let (client, server) = (client.into_split(), server.into_split());
            tokio::select! {
                () = copy(client.0, server.1, cut.clone()) => {}
                () = copy(server.0, client.1, cut) => {}
            }
            return;
        }
    }
}

/// Until one of both is gone.
async fn copy(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    mut cut: watch::Receiver<bool>,
) {
    let mut buffer = vec![0; 64 << 10];
    while let Ok(count @ 1..) = from.read(&mut buffer).await {
        if cut.wait_for(|cut| !cut).await.is_err() || to.write_all(&buffer[..count]).await.is_err() {
            return;
        }
    }
}
