//! The codec of the services: prost's, which asks before it makes values of bytes that came.

use std::fmt;
use std::future::Future;
use std::marker::PhantomData;
use std::sync::Arc;

use bytes::Buf as _;
use prost::{Message, Name};
use tonic::Status;
use tonic::codec::{BufferSettings, Codec, DecodeBuf, Decoder};
use tonic_prost::{ProstCodec, ProstDecoder, ProstEncoder};

use crate::cost::Shape;

/// What is told how much memory the next message of a call takes once it is decoded, bytes; what it refuses is not decoded.
pub type Account = Arc<dyn Fn(u64) -> Result<(), Status> + Send + Sync>;

tokio::task_local! {
    /// The account of the call that is being answered.
    static ACCOUNT: Account;
}

/// Answers a call whose messages, also those of a stream that outlives it, are asked for at `account` before they are decoded.
pub async fn accounted<F: Future>(account: Account, answer: F) -> F::Output {
    ACCOUNT.scope(account, answer).await
}

/// The codec that generated clients and servers use.
#[derive(Debug)]
pub struct AccountedCodec<T, U>(PhantomData<(T, U)>);

impl<T, U> Default for AccountedCodec<T, U> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T, U> Codec for AccountedCodec<T, U>
where
    T: Message + Send + 'static,
    U: Message + Name + Default + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = ProstEncoder<T>;
    type Decoder = AccountedDecoder<U>;

    fn encoder(&mut self) -> Self::Encoder {
        ProstCodec::<T, U>::default().encoder()
    }

    fn decoder(&mut self) -> Self::Decoder {
        // A server makes it while it answers, a client outside of any answer.
        let account = ACCOUNT.try_with(Arc::clone).ok();
        AccountedDecoder {
            inner: ProstDecoder::default(),
            account: account.map(|it| (it, Shape::named(&U::full_name()))),
        }
    }
}

/// Decodes what the account of the call allows.
pub struct AccountedDecoder<U> {
    inner: ProstDecoder<U>,
    /// With the kind of the messages; `None` for a kind without descriptor.
    account: Option<(Account, Option<Shape>)>,
}

impl<U> fmt::Debug for AccountedDecoder<U> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AccountedDecoder").field("is_accounted", &self.account.is_some()).finish_non_exhaustive()
    }
}

impl<U: Message + Name + Default> Decoder for AccountedDecoder<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buf: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        if let Some((account, shape)) = &self.account {
            let shape = shape.ok_or_else(|| Status::internal(format!("{} has no descriptor", U::full_name())))?;
            // A message is in one piece.
            account(shape.decoded_bytes(buf.chunk()))?;
        }
        self.inner.decode(buf)
    }

    fn buffer_settings(&self) -> BufferSettings {
        self.inner.buffer_settings()
    }
}
