//! Messages of the protocol on two streams, each with its length before it. What is no message is told apart from a stream that
//! has broken: after the one the next message is read, after the other there is none.

use std::io::{self, BufRead, Read as _, Write};

use lsp_server::{ErrorCode, Message};
use serde_json::{Value, json};

/// Longest message that is read, bytes.
pub(super) const MAX_MESSAGE_BYTES: u64 = 64 << 20;
/// Longest line of a header, bytes.
const MAX_HEADER_BYTES: u64 = 4_096;
/// Most lines of a header.
const MAX_HEADER_LINES: usize = 32;

/// What came.
#[derive(Debug)]
pub(super) enum Received {
    /// A message.
    Message(Message),
    /// Something that is none; the answer to it.
    Malformed(Value),
    /// The stream has ended.
    Ended,
}

/// Reads the next message.
///
/// # Errors
/// When the stream breaks: no length, a header that is none, an end within a message.
pub(super) fn receive(input: &mut impl BufRead) -> io::Result<Received> {
    let Some(length) = read_header(input)? else { return Ok(Received::Ended) };
    if length > MAX_MESSAGE_BYTES {
        if io::copy(&mut input.take(length), &mut io::sink())? < length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let message = format!("a message has at most {MAX_MESSAGE_BYTES} bytes, this one has {length}");
        return Ok(Received::Malformed(refusal(Value::Null, ErrorCode::InvalidRequest, &message)));
    }
    let mut body = Vec::new();
    if input.take(length).read_to_end(&mut body)? < length as usize {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    let value: Value = match serde_json::from_slice(&body) {
        Ok(value) => value,
        Err(error) => {
            let message = format!("not JSON: {error}");
            return Ok(Received::Malformed(refusal(Value::Null, ErrorCode::ParseError, &message)));
        }
    };
    let id = value.get("id").filter(|id| id.is_string() || id.is_i64()).cloned().unwrap_or_default();
    Ok(match serde_json::from_value(value) {
        Ok(message) => Received::Message(message),
        Err(_) => Received::Malformed(refusal(id, ErrorCode::InvalidRequest, "no request, response or notification")),
    })
}

/// The length that a header states; `None` at the end of the stream.
fn read_header(input: &mut impl BufRead) -> io::Result<Option<u64>> {
    let broken = |message: &str| io::Error::new(io::ErrorKind::InvalidData, message.to_owned());
    let mut length = None;
    for number in 0..MAX_HEADER_LINES {
        let mut line = Vec::new();
        let read = input.take(MAX_HEADER_BYTES).read_until(b'\n', &mut line)?;
        if read == 0 && number == 0 {
            return Ok(None);
        }
        let Some(line) = line.strip_suffix(b"\n") else { return Err(broken("a header line has no end")) };
        let line = String::from_utf8_lossy(line.trim_ascii_end());
        if line.is_empty() {
            return length.map(Some).ok_or_else(|| broken("a header without Content-Length"));
        }
        let Some((name, value)) = line.split_once(':') else { return Err(broken("a header line without a colon")) };
        if name.trim().eq_ignore_ascii_case("Content-Length") {
            let parsed = value.trim().parse::<u64>();
            length = Some(parsed.map_err(|_| broken("Content-Length is no number"))?);
        }
    }
    Err(broken("a header of too many lines"))
}

/// An error as an answer; `id` is null where it is not known.
pub(super) fn refusal(id: Value, code: ErrorCode, message: &str) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "error": { "code": code as i32, "message": message } })
}

/// Writes a message.
///
/// # Errors
/// When the stream has broken.
pub(super) fn send(output: &mut impl Write, message: &Value) -> io::Result<()> {
    let body = message.to_string();
    write!(output, "Content-Length: {}\r\n\r\n{body}", body.len())?;
    output.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Vec<String> {
        let mut input = bytes;
        let mut all = Vec::new();
        loop {
            match receive(&mut input) {
                Ok(Received::Message(Message::Request(request))) => all.push(request.method),
                Ok(Received::Message(other)) => all.push(format!("{other:?}")),
                Ok(Received::Malformed(answer)) => {
                    all.push(answer["error"]["code"].to_string() + &answer["id"].to_string());
                }
                Ok(Received::Ended) => return all,
                Err(error) => {
                    all.push(error.to_string());
                    return all;
                }
            }
        }
    }

    fn framed(body: &str) -> String {
        format!("Content-Length: {}\r\nContent-Type: x\r\n\r\n{body}", body.len())
    }

    #[test]
    fn what_is_no_message_is_answered_and_the_next_one_read() {
        let request = framed(r#"{"jsonrpc":"2.0","id":1,"method":"a"}"#);
        let all =
            [framed("{"), framed("\u{fffd}[]"), framed(r#"{"id":7}"#), framed("[1]"), framed(""), request.clone()];
        assert_eq!(
            read(all.concat().as_bytes()),
            ["-32700null", "-32700null", "-326007", "-32600null", "-32700null", "a"]
        );
        let mut not_utf8 = b"Content-Length: 2\r\n\r\n\xff\xfe".to_vec();
        not_utf8.extend(request.as_bytes());
        assert_eq!(read(&not_utf8), ["-32700null", "a"]);
    }

    #[test]
    fn a_broken_stream_ends_with_its_reason() {
        assert_eq!(read(b""), Vec::<String>::new());
        for (bytes, reason) in [
            ("\r\n", "a header without Content-Length"),
            ("Content-Length: x\r\n\r\n", "Content-Length is no number"),
            ("Content-Length: -1\r\n\r\n", "Content-Length is no number"),
            ("nonsense\r\n", "a header line without a colon"),
            ("Content-Length: 5", "a header line has no end"),
            ("Content-Length: 5\r\n\r\n{}", "unexpected end of file"),
            ("Content-Length: 99999999999\r\n\r\n{}", "unexpected end of file"),
        ] {
            assert_eq!(read(bytes.as_bytes()), [reason], "{bytes:?}");
        }
        assert_eq!(read("a".repeat(10_000).as_bytes()), ["a header line has no end"]);
        assert_eq!(read("a: b\r\n".repeat(100).as_bytes()), ["a header of too many lines"]);
    }

    #[test]
    fn a_message_that_is_too_long_is_passed_over() {
        let long = MAX_MESSAGE_BYTES + 1;
        let mut bytes = format!("Content-Length: {long}\r\n\r\n").into_bytes();
        bytes.resize(bytes.len() + long as usize, b' ');
        bytes.extend(framed(r#"{"id":"b","method":"a"}"#).as_bytes());
        assert_eq!(read(&bytes), ["-32600null", "a"]);
    }
}
