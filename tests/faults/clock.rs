//! A clock that jumps.

use feedwave_contract::proto::ListJobsRequest;
use feedwave_tests::Home;

use crate::FEEDWAVE;
use crate::library::Faults;

#[tokio::test]
async fn jobs_are_in_the_order_of_their_creation_whatever_the_clock_does() {
    let faults = Faults::new();
    let mut home = Home::new(FEEDWAVE, "");
    home.set_environment(faults.environment.clone());
    let mut server = home.start().await;
    let mut created = Vec::new();
    const YEAR_S: i64 = 31_557_600;
    for offset_s in [0, 10 * YEAR_S, 0, -10 * YEAR_S, 3_600, 0] {
        faults.clock_ahead(offset_s);
        let mut clients = server.connect().await;
        for _ in 0..2 {
            created.push(clients.submit("G21\nM30\n").await.job.name);
        }
        server = server.kill().await.start().await;
        server.connect().await.submit("G21\nM30\n").await;
        created.push(String::new());
    }
    let mut clients = server.connect().await;
    let (mut listed, mut page_token) = (Vec::new(), String::new());
    loop {
        let request = ListJobsRequest { page_size: 2, page_token, ..ListJobsRequest::default() };
        let page = clients.jobs.list_jobs(request).await.expect("the jobs are listed").into_inner();
        listed.extend(page.jobs.into_iter().map(|job| job.name));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    created.reverse();
    assert_eq!(listed.len(), created.len());
    for (listed, created) in listed.iter().zip(&created).filter(|(_, created)| !created.is_empty()) {
        assert_eq!(listed, created);
    }
}
