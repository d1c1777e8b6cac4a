//! Connections: bounded in number, each with time limits for its head and for reading its answer, and a graceful end.

use std::{
    net::SocketAddr,
    sync::{Arc, atomic::Ordering},
    time::Duration,
};

use axum::{Router, extract::Request};
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::graceful::GracefulShutdown,
};
use tokio::{
    io::AsyncWriteExt as _,
    net::{TcpListener, TcpStream},
    sync::Semaphore,
};
use tokio_util::sync::CancellationToken;
use tower::ServiceExt as _;

use super::{app::App, guard::Peer, stall::Stall};

const CONNECTIONS: usize = 256;
/// Connections beyond the limit that receive a refusal; further ones are closed without an answer.
const REFUSALS: usize = 256;
const HEADERS: usize = 64;
const HEAD_BYTES: usize = 32 << 10;
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time for connections to end after a request to stop.
const END_TIME: Duration = Duration::from_secs(10);
const FULL: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";

/// Answers until the service ends.
pub(super) async fn run(listener: TcpListener, router: Router, app: &Arc<App>) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    let refusals = Arc::new(Semaphore::new(REFUSALS));
    let graceful = GracefulShutdown::new();
    let cut = CancellationToken::new();
    let ending = app.shared.ending.clone();
    loop {
        let accepted = tokio::select! {
            () = ending.cancelled() => break,
            accepted = listener.accept() => accepted,
        };
        let (stream, peer) = match accepted {
            Ok(accepted) => accepted,
            Err(error) => {
                // The process has no free file descriptor: other connections must end first.
                tracing::warn!("a connection was not accepted: {error}");
                tokio::time::sleep(Duration::from_millis(100)).await;
                continue;
            }
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            if let Ok(refusal) = Arc::clone(&refusals).try_acquire_owned() {
                tokio::spawn(async move {
                    let _ = tokio::time::timeout(HEAD_TIME, refuse(stream)).await;
                    drop(refusal);
                });
            }
            continue;
        };
        let (app, router, watcher, cut) = (
            Arc::clone(app),
            router.clone(),
            graceful.watcher(),
            cut.clone(),
        );
        tokio::spawn(async move {
            app.connections.fetch_add(1, Ordering::Relaxed);
            let connection = watcher.watch(connection(stream, peer, router));
            tokio::select! {
                // A client that disconnects, or is too slow, is not logged.
                ended = connection => drop(ended),
                () = cut.cancelled() => {}
            }
            app.connections.fetch_sub(1, Ordering::Relaxed);
            drop(place);
        });
    }
    drop(listener);
    if tokio::time::timeout(END_TIME, graceful.shutdown())
        .await
        .is_err()
    {
        tracing::warn!("some connections did not end in time and were closed");
    }
    cut.cancel();
}

fn connection(
    stream: TcpStream,
    peer: SocketAddr,
    router: Router,
) -> http1::Connection<
    TokioIo<Stall<TcpStream>>,
    impl hyper::service::Service<
        hyper::Request<Incoming>,
        Response = axum::response::Response,
        Error = std::convert::Infallible,
        Future: Send,
    >,
> {
    // Small answers should not wait for more.
    let _ = stream.set_nodelay(true);
    let service = service_fn(move |request: hyper::Request<Incoming>| {
        let mut request: Request = request.map(axum::body::Body::new);
        request.extensions_mut().insert(Peer(peer));
        router.clone().oneshot(request)
    });
    http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_headers(HEADERS)
        .max_header_size(HEAD_BYTES)
        .serve_connection(TokioIo::new(Stall::new(stream)), service)
}

/// Sends a refusal, and reads the rest of the request, without which the client would not receive the answer.
async fn refuse(mut stream: TcpStream) -> std::io::Result<()> {
    stream.write_all(FULL).await?;
    stream.shutdown().await?;
    tokio::io::copy(&mut stream, &mut tokio::io::sink()).await?;
    Ok(())
}
