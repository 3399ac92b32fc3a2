//! Calls of any method with any bytes, as the descriptors of the contract name them.

use bytes::Bytes;
use feedwave_contract::proto::DESCRIPTORS;
use feedwave_tests::Raw;
use prost_reflect::MethodDescriptor;
use tonic::client::Grpc;
use tonic::codec::CompressionEncoding;
use tonic::transport::Channel;
use tonic::{Request, Response, Status, Streaming};

/// Every method of the contract.
pub fn methods() -> Vec<MethodDescriptor> {
    DESCRIPTORS.services().flat_map(|service| service.methods().collect::<Vec<_>>()).collect()
}

/// Its path in a request.
pub fn path(method: &MethodDescriptor) -> String {
    format!("/{}/{}", method.parent_service().full_name(), method.name())
}

/// A call of any kind with these messages and no further ones.
pub async fn call(
    channel: &Channel,
    path: &str,
    messages: Vec<Bytes>,
    compressed: bool,
) -> Result<Response<Streaming<Bytes>>, Status> {
    let mut client = Grpc::new(channel.clone());
    if compressed {
        client = client.send_compressed(CompressionEncoding::Gzip).accept_compressed(CompressionEncoding::Gzip);
    }
    client.ready().await.unwrap();
    client.streaming(Request::new(tokio_stream::iter(messages)), path.parse().unwrap(), Raw).await
}

/// The status that a call ends with; `Ok` where it answers or goes on.
pub async fn outcome(channel: &Channel, path: &str, messages: Vec<Bytes>, compressed: bool) -> Result<(), Status> {
    let mut stream = call(channel, path, messages, compressed).await?.into_inner();
    stream.message().await.map(drop)
}
