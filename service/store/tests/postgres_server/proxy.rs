//! A way to a server that can be cut without a word, as by a failover or a translation of addresses that forgets.

use std::future::pending;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::io::copy_bidirectional;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

/// Passes connections on to a server.
pub struct Proxy {
    port: u16,
    /// Whether connections that are made from now on are passed on. Those made before have one of their own.
    passes: Arc<Mutex<watch::Sender<bool>>>,
}

impl Proxy {
    /// A way to a port of this computer.
    pub async fn to(server: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let port = listener.local_addr().unwrap().port();
        let passes = Arc::new(Mutex::new(watch::channel(true).0));
        let all = passes.clone();
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let passes = all.lock().unwrap_or_else(PoisonError::into_inner).subscribe();
                tokio::spawn(pass(client, server, passes));
            }
        });
        Self { port, passes }
    }

    pub const fn port(&self) -> u16 {
        self.port
    }

    /// Nothing comes through the connections that there are any more, and they stay open. New ones pass, or do not.
    pub fn cut(&self, new_ones_pass: bool) {
        let new = watch::channel(new_ones_pass).0;
        let old = std::mem::replace(&mut *self.passes.lock().unwrap_or_else(PoisonError::into_inner), new);
        old.send_replace(false);
    }
}

async fn pass(mut client: TcpStream, server: u16, mut passes: watch::Receiver<bool>) {
    let mut server = TcpStream::connect(("127.0.0.1", server)).await.unwrap();
    let cut = async {
        if passes.wait_for(|passes| !passes).await.is_err() {
            pending::<()>().await;
        }
    };
    tokio::select! {
        biased;
        () = cut => pending().await,
        // A side that ended is nothing to tell of.
        _ = copy_bidirectional(&mut client, &mut server) => {}
    }
}
