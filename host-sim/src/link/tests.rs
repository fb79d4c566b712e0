use super::*;
use std::time::Instant;

pub(super) fn hear(link: &mut dyn ByteLink) -> Vec<u8> {
    let mut buffer = [0; 2048];
    let start = Instant::now();
    while start.elapsed() < Duration::from_secs(5) {
        let len = link.receive(&mut buffer).unwrap();
        if len > 0 {
            return buffer[..len].to_vec();
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    panic!("nothing heard in five seconds");
}

fn open(text: &str) -> Box<dyn ByteLink> {
    text.parse::<LinkUrl>().unwrap().open().unwrap()
}

#[test]
fn urls_are_read_and_written_alike() {
    for text in [
        "tcp:localhost:5760",
        "tcp-listen:0.0.0.0:0",
        "udp:[::1]:14540",
        "serial:/dev/ttyACM0:921600",
    ] {
        assert_eq!(text.parse::<LinkUrl>().unwrap().to_string(), text);
    }
}

#[test]
fn bad_urls_say_what_is_wrong() {
    for (text, why) in [
        ("127.0.0.1", "expected tcp:"),
        ("tcp:127.0.0.1", "expected HOST:PORT"),
        ("http:127.0.0.1:80", "expected tcp:"),
        ("udp:127.0.0.1:65536", "port"),
        ("udp::14550", "empty"),
        ("serial:/dev/ttyS0:fast", "baud"),
    ] {
        let error = text.parse::<LinkUrl>().unwrap_err().to_string();
        assert!(error.contains(why) && error.contains(text), "{text}: {error}");
    }
}

#[test]
fn a_tcp_server_talks_to_one_client_after_another() {
    let mut server = open("tcp-listen:127.0.0.1:0");
    let url = format!("tcp:{}", server.local_address().unwrap());
    for _ in 0..2 {
        let mut client = open(&url);
        client.send(b"ping").unwrap();
        assert_eq!(hear(&mut *server), b"ping");
        server.send(b"pong").unwrap();
        assert_eq!(hear(&mut *client), b"pong");
    }
    // The last client has gone: the server carries on without one.
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(server.receive(&mut [0; 16]).unwrap(), 0);
    server.send(b"to nobody").unwrap();
}

#[test]
fn a_tcp_client_comes_back_to_a_server_that_restarts() {
    let server = open("tcp-listen:127.0.0.1:0");
    let at = server.local_address().unwrap();
    let mut client = open(&format!("tcp:{at}"));
    drop(server);
    let start = Instant::now();
    while client.local_address().is_some() {
        assert_eq!(client.receive(&mut [0; 16]).unwrap(), 0, "lost, and no error");
        assert!(start.elapsed() < Duration::from_secs(5));
    }
    let mut server = open(&format!("tcp-listen:{at}"));
    while client.local_address().is_none() {
        client.send(b"dropped").unwrap();
        assert!(start.elapsed() < Duration::from_secs(20));
    }
    client.send(b"ping").unwrap();
    assert!(hear(&mut *server).ends_with(b"ping"));
}

#[test]
fn a_udp_hub_answers_every_peer_that_sent() {
    let mut hub = open("udp-listen:127.0.0.1:0");
    let url = format!("udp:{}", hub.local_address().unwrap());
    let (mut a, mut b) = (open(&url), open(&url));
    a.send(b"a").unwrap();
    assert_eq!(hear(&mut *hub), b"a");
    b.send(b"b").unwrap();
    assert_eq!(hear(&mut *hub), b"b");
    hub.send(b"all").unwrap();
    assert_eq!(hear(&mut *a), b"all");
    assert_eq!(hear(&mut *b), b"all");
}

#[test]
fn a_udp_peer_that_does_not_listen_is_no_error() {
    let closed = std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let mut peer = open(&format!("udp:{closed}"));
    for _ in 0..3 {
        peer.send(b"anyone?").unwrap();
        std::thread::sleep(Duration::from_millis(5));
        assert_eq!(peer.receive(&mut [0; 16]).unwrap(), 0);
    }
}
