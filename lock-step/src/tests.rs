use super::*;

#[test]
fn records_arrive_as_they_were_sent() {
    let (port, len, address) = (1, 513, 0x6000_0001);
    for record in [
        ToBoard::Bytes { port, len, due_us: 1 << 40 },
        ToBoard::Run { until_us: 3 << 33 },
        ToBoard::Peek { address, len },
        ToBoard::Poke { address, len },
        ToBoard::Call { address, argument: 7 },
    ] {
        assert_eq!(ToBoard::from_bytes(&record.to_bytes()), Some(record));
    }
    for record in [
        FromBoard::Started,
        FromBoard::Sent { port, len, at_us: 5 << 34 },
        FromBoard::Memory { len },
        FromBoard::Waits { now_us: u64::MAX },
    ] {
        assert_eq!(FromBoard::from_bytes(&record.to_bytes()), Some(record));
    }
    assert_eq!(ToBoard::from_bytes(&[9; HEADER_LEN]), None);
    assert_eq!(FromBoard::from_bytes(&[9; HEADER_LEN]), None);
}
