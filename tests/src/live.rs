//! A client of live runs that takes what it is sent.

use feedwave_contract::proto::run_request::Message as Request;
use feedwave_contract::proto::run_response::Message;
use feedwave_contract::proto::run_start::Target;
use feedwave_contract::proto::runs_client::RunsClient;
use feedwave_contract::proto::{
    Decision, RunCommand, RunCommandKind, RunCredit, RunEnded, RunFeedChange, RunReceipt, RunRequest, RunResponse,
    RunSettings, RunSpindleRequest, RunStart, RunStarted,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

use crate::patiently;

/// A live run in progress, with everything that was received of it.
#[derive(Debug)]
pub struct LiveClient {
    requests: mpsc::Sender<RunRequest>,
    responses: Streaming<RunResponse>,
    /// The service's first answer.
    pub started: RunStarted,
    /// Changes of the feed, those before it was taken up included.
    pub changes: Vec<RunFeedChange>,
    /// Index of the next setpoint.
    pub next_index: u64,
    /// Bits of the setpoints received, setpoint by setpoint.
    pub setpoints: Vec<Vec<u64>>,
    /// Decisions received.
    pub decisions: Vec<Decision>,
    /// Changes of the spindle speed that were requested.
    pub spindle_requests: Vec<RunSpindleRequest>,
}

impl LiveClient {
    /// Begins a run of a job.
    ///
    /// # Errors
    /// Those of the service.
    pub async fn begin(channel: Channel, job: &str, settings: RunSettings) -> Result<Self, Status> {
        let target = Some(Target::Job(job.to_owned()));
        Self::open(channel, RunStart { target, settings: Some(settings), ..RunStart::default() }).await
    }

    /// Takes a run up at a setpoint.
    ///
    /// # Errors
    /// Those of the service.
    pub async fn take_up(channel: Channel, run: &str, start_index: u64) -> Result<Self, Status> {
        let target = Some(Target::Run(run.to_owned()));
        Self::open(channel, RunStart { target, start_index, ..RunStart::default() }).await
    }

    /// # Panics
    /// Where the service begins with anything but its start.
    async fn open(channel: Channel, start: RunStart) -> Result<Self, Status> {
        let (requests, messages) = mpsc::channel(64);
        let next_index = start.start_index;
        let first = RunRequest { message: Some(Request::Start(start)) };
        requests.send(first).await.map_err(|_| Status::internal("the channel is open"))?;
        let mut responses = RunsClient::new(channel).run(ReceiverStream::new(messages)).await?.into_inner();
        match patiently(responses.message()).await?.and_then(|response| response.message) {
            Some(Message::Started(started)) => {
                let changes = started.feed_changes.clone();
                let (setpoints, decisions, spindle_requests) = (Vec::new(), Vec::new(), Vec::new());
                Ok(Self { requests, responses, started, changes, next_index, setpoints, decisions, spindle_requests })
            }
            other => panic!("a run begins with its start, not with {other:?}"),
        }
    }

    /// Says something; a run that has ended listens no more, and says so in its answers.
    pub async fn say(&self, message: Request) {
        let _ = self.requests.send(RunRequest { message: Some(message) }).await;
    }

    /// Permits setpoints before this one.
    pub async fn credit(&self, end_index: u64) {
        self.say(Request::Credit(RunCredit { end_index })).await;
    }

    /// Acknowledges everything that was received.
    pub async fn receipt(&self) {
        self.say(Request::Receipt(RunReceipt { received: self.next_index })).await;
    }

    /// Reads one message; the end, where it is that.
    ///
    /// # Errors
    /// Those of the service.
    ///
    /// # Panics
    /// Where setpoints do not follow each other, or the run ends without saying so.
    pub async fn next(&mut self) -> Result<Option<RunEnded>, Status> {
        let response = patiently(self.responses.message()).await?;
        match response.and_then(|response| response.message).expect("a run does not end without saying so") {
            Message::Chunk(chunk) => {
                assert_eq!(chunk.first_index, self.next_index, "chunks follow each other");
                self.next_index += u64::from(chunk.count);
                let row = |row: usize| chunk.columns.iter().map(|column| column.values[row].to_bits()).collect();
                self.setpoints.extend((0..chunk.count as usize).map(row));
            }
            Message::FeedChange(change) => self.changes.push(change),
            Message::Ended(ended) => return Ok(Some(ended)),
            Message::Decision(decision) => self.decisions.push(decision),
            Message::SpindleRequest(request) => self.spindle_requests.push(request),
            Message::Ack(_) | Message::CommandRefused(_) | Message::Started(_) => {}
        }
        Ok(None)
    }

    /// Asks for the setpoints before this one, reads them, and acknowledges them.
    ///
    /// # Errors
    /// Those of the service.
    ///
    /// # Panics
    /// Where the run ends before.
    pub async fn reach(&mut self, index: u64) -> Result<(), Status> {
        self.credit(index).await;
        while self.next_index < index {
            assert_eq!(self.next().await?, None);
        }
        self.receipt().await;
        Ok(())
    }

    /// Commands something that changes the feed; the change.
    ///
    /// # Errors
    /// Those of the service.
    ///
    /// # Panics
    /// Where the run ends before.
    pub async fn command(&mut self, kind: RunCommandKind) -> Result<RunFeedChange, Status> {
        let before = self.changes.len();
        self.say(Request::Command(RunCommand { kind: kind.into() })).await;
        while self.changes.len() == before {
            assert_eq!(self.next().await?, None);
        }
        Ok(self.changes[before])
    }

    /// Takes everything there is, to the end.
    ///
    /// # Errors
    /// Those of the service.
    pub async fn finish(&mut self) -> Result<RunEnded, Status> {
        self.credit(u64::MAX).await;
        loop {
            let received = self.next_index;
            if let Some(ended) = self.next().await? {
                return Ok(ended);
            }
            if self.next_index > received {
                self.receipt().await;
            }
        }
    }
}
