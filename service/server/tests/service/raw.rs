//! Calls of any method with any bytes, as the descriptors of the contract name them.

use bytes::{Buf as _, BufMut as _, Bytes};
use feedwave_contract::proto::DESCRIPTORS;
use prost_reflect::MethodDescriptor;
use tonic::client::Grpc;
use tonic::codec::{Codec, CompressionEncoding, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::transport::Channel;
use tonic::{Request, Response, Status, Streaming};

/// Messages as they are on the wire.
#[derive(Clone, Copy)]
pub struct Raw;

impl Codec for Raw {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        Self
    }

    fn decoder(&mut self) -> Self {
        Self
    }
}

impl Encoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn encode(&mut self, item: Bytes, into: &mut EncodeBuf<'_>) -> Result<(), Status> {
        into.put(item);
        Ok(())
    }
}

impl Decoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn decode(&mut self, from: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(from.copy_to_bytes(from.remaining())))
    }
}

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
