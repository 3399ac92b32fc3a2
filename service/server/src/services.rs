//! The gRPC services, registered in one place and under one set of rules: the same largest message, gzip accepted
//! from every client and sent to those that ask for it.

use feedwave_contract::proto::audit_server::AuditServer;
use feedwave_contract::proto::jobs_server::JobsServer;
use feedwave_contract::proto::machines_server::MachinesServer;
use feedwave_contract::proto::programs_server::ProgramsServer;
use feedwave_contract::proto::runs_server::RunsServer;
use feedwave_contract::proto::setpoints_server::SetpointsServer;
use feedwave_contract::proto::telemetry_server::TelemetryServer;
use feedwave_contract::proto::threads_server::ThreadsServer;
use feedwave_contract::proto::tools_server::ToolsServer;
use feedwave_contract::proto::{DESCRIPTOR_SET, DESCRIPTORS};
use tonic::codec::CompressionEncoding;
use tonic::service::Routes;
use tonic_health::server::HealthReporter;

use crate::api::Api;

/// Methods whose answers are never compressed, whatever a client asks for (many ask by default): streams of setpoints,
/// which gzip makes thirty times slower, and streams that live beside a machine, where it only costs time.
const UNCOMPRESSED: [&str; 4] = [
    "/feedwave.v1.Setpoints/StreamSetpoints",
    "/feedwave.v1.Runs/Run",
    "/feedwave.v1.Threads/FollowSpindle",
    "/feedwave.v1.Telemetry/Ingest",
];

/// Whether the answers of a method may be compressed.
pub(crate) fn may_compress(path: &str) -> bool {
    !UNCOMPRESSED.contains(&path)
}

/// Name for health that says only that the process answers, from its start to its end, whatever the store does: restarting
/// a service that cannot write helps nothing. `/healthz` says the same over HTTP.
pub(crate) const LIVENESS: &str = "liveness";

/// Names of the services of the contract, for health; the empty one is the whole server.
pub(crate) fn names() -> Vec<String> {
    let services = DESCRIPTORS.services().filter(|service| service.package_name() == "feedwave.v1");
    std::iter::once(String::new()).chain(services.map(|service| service.full_name().to_owned())).collect()
}

/// Every service, with health and reflection.
pub(crate) fn routes(
    api: &Api,
    message_bytes: usize,
    health: &HealthReporter,
) -> Result<Routes, tonic_reflection::server::Error> {
    /// The rules; generated servers share no trait that they could be written against.
    macro_rules! ruled {
        ($server:expr) => {
            $server
                .max_decoding_message_size(message_bytes)
                .accept_compressed(CompressionEncoding::Gzip)
                .send_compressed(CompressionEncoding::Gzip)
        };
    }
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(DESCRIPTOR_SET)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let health = tonic_health::server::HealthService::from_health_reporter(health.clone());
    Ok(Routes::new(ruled!(JobsServer::new(api.clone())))
        .add_service(ruled!(ProgramsServer::new(api.clone())))
        .add_service(ruled!(SetpointsServer::new(api.clone())))
        .add_service(ruled!(ThreadsServer::new(api.clone())))
        .add_service(ruled!(RunsServer::new(api.clone())))
        .add_service(ruled!(TelemetryServer::new(api.clone())))
        .add_service(ruled!(AuditServer::new(api.clone())))
        .add_service(ruled!(MachinesServer::new(api.clone())))
        .add_service(ruled!(ToolsServer::new(api.clone())))
        .add_service(ruled!(tonic_health::pb::health_server::HealthServer::new(health)))
        .add_service(ruled!(reflection().build_v1()?))
        .add_service(ruled!(reflection().build_v1alpha()?))
        .prepare())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_that_are_not_compressed_exist_and_stream() {
        for path in UNCOMPRESSED {
            let (service, method) = path[1..].split_once('/').unwrap();
            let service = DESCRIPTORS.get_service_by_name(service).unwrap_or_else(|| panic!("no service of {path}"));
            let method = service.methods().find(|found| found.name() == method);
            assert!(method.unwrap_or_else(|| panic!("no {path}")).is_server_streaming(), "{path}");
        }
    }
}
