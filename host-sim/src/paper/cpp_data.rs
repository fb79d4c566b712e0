//! Values that paper CPP (Luna 2022) prints in its Tables 2 to 6 and A1 to A12.

/// One of Tables A1 to A12: flight times of each vehicle in Gazebo, seconds, for six pairs of lane
/// spacing and height.
pub(super) struct FlightTimesTable {
    /// Number of the table.
    pub(super) name: &'static str,
    /// Whether the track is the long one, with lanes of 320 m; the short one has lanes of 150 m.
    pub(super) is_long_track: bool,
    /// Name of the method by which the whole table was flown, as in a scenario.
    pub(super) method: &'static str,
    /// Flight times, seconds: for each of the table's six columns one value a vehicle.
    pub(super) times_s: [&'static [f64]; 6],
}

/// Columns of the tables of the short track: spacing and height, metres.
pub(super) const SHORT_TRACK_COLUMNS: [(f64, f64); 6] =
    [(10.0, 35.0), (10.0, 45.0), (10.0, 55.0), (5.0, 35.0), (5.0, 45.0), (5.0, 55.0)];
/// Columns of the tables of the long track: spacing and height, metres.
pub(super) const LONG_TRACK_COLUMNS: [(f64, f64); 6] =
    [(10.0, 35.0), (10.0, 45.0), (10.0, 55.0), (15.0, 35.0), (15.0, 45.0), (15.0, 55.0)];

/// Tables A1 to A12.
pub(super) const FLIGHT_TIMES_TABLES: [FlightTimesTable; 12] = [
    FlightTimesTable {
        name: "A1",
        is_long_track: false,
        method: "simple-binpat",
        times_s: [
            &[318.0, 331.0, 312.0],
            &[330.0, 345.0, 326.0],
            &[344.0, 356.0, 337.0],
            &[266.0, 268.0, 226.0],
            &[277.0, 280.0, 237.0],
            &[287.0, 293.0, 248.0],
        ],
    },
    FlightTimesTable {
        name: "A2",
        is_long_track: false,
        method: "binpat",
        times_s: [
            &[214.0, 232.0, 244.0],
            &[258.0, 294.0, 261.0],
            &[280.0, 313.0, 272.0],
            &[383.0, 396.0, 410.0],
            &[385.0, 399.0, 411.0],
            &[426.0, 412.0, 396.0],
        ],
    },
    FlightTimesTable {
        name: "A3",
        is_long_track: false,
        method: "powell-binpat",
        times_s: [
            &[243.0, 258.0, 245.0],
            &[262.0, 284.0, 280.0],
            &[266.0, 286.0, 273.0],
            &[397.0, 400.0, 373.0],
            &[385.0, 413.0, 401.0],
            &[401.0, 426.0, 412.0],
        ],
    },
    FlightTimesTable {
        name: "A4",
        is_long_track: false,
        method: "simple-binpat",
        times_s: [
            &[225.0, 232.0, 249.0, 222.0, 222.0],
            &[236.0, 247.0, 260.0, 233.0, 231.0],
            &[249.0, 259.0, 271.0, 245.0, 245.0],
            &[287.0, 283.0, 234.0, 259.0, 290.0],
            &[302.0, 302.0, 246.0, 271.0, 304.0],
            &[314.0, 308.0, 358.0, 284.0, 316.0],
        ],
    },
    FlightTimesTable {
        name: "A5",
        is_long_track: false,
        method: "binpat",
        times_s: [
            &[237.0, 204.0, 210.0, 229.0, 244.0],
            &[260.0, 231.0, 262.0, 233.0, 271.0],
            &[258.0, 231.0, 260.0, 233.0, 269.0],
            &[322.0, 319.0, 388.0, 380.0, 323.0],
            &[335.0, 332.0, 298.0, 295.0, 336.0],
            &[318.0, 350.0, 352.0, 312.0, 355.0],
        ],
    },
    FlightTimesTable {
        name: "A6",
        is_long_track: false,
        method: "powell-binpat",
        times_s: [
            &[228.0, 213.0, 237.0, 240.0, 246.0],
            &[254.0, 226.0, 242.0, 245.0, 257.0],
            &[251.0, 239.0, 266.0, 266.0, 273.0],
            &[289.0, 315.0, 304.0, 325.0, 327.0],
            &[303.0, 324.0, 319.0, 338.0, 339.0],
            &[311.0, 355.0, 329.0, 338.0, 351.0],
        ],
    },
    FlightTimesTable {
        name: "A7",
        is_long_track: true,
        method: "simple-binpat",
        times_s: [
            &[817.0, 834.0, 749.0],
            &[870.0, 917.0, 1225.0],
            &[985.0, 856.0, 1050.0],
            &[606.0, 652.0, 567.0],
            &[693.0, 843.0, 759.0],
            &[680.0, 799.0, 832.0],
        ],
    },
    FlightTimesTable {
        name: "A8",
        is_long_track: true,
        method: "binpat",
        times_s: [
            &[859.0, 891.0, 915.0],
            &[889.0, 973.0, 986.0],
            &[973.0, 1010.0, 946.0],
            &[676.0, 675.0, 696.0],
            &[652.0, 714.0, 763.0],
            &[745.0, 697.0, 633.0],
        ],
    },
    FlightTimesTable {
        name: "A9",
        is_long_track: true,
        method: "powell-binpat",
        times_s: [
            &[855.0, 894.0, 898.0],
            &[970.0, 938.0, 900.0],
            &[967.0, 961.0, 999.0],
            &[606.0, 671.0, 625.0],
            &[629.0, 692.0, 643.0],
            &[636.0, 700.0, 652.0],
        ],
    },
    FlightTimesTable {
        name: "A10",
        is_long_track: true,
        method: "simple-binpat",
        times_s: [
            &[579.0, 619.0, 583.0, 544.0, 685.0],
            &[637.0, 678.0, 644.0, 588.0, 727.0],
            &[682.0, 752.0, 686.0, 596.0, 801.0],
            &[494.0, 510.0, 461.0, 562.0, 551.0],
            &[653.0, 596.0, 542.0, 581.0, 639.0],
            &[596.0, 618.0, 547.0, 683.0, 673.0],
        ],
    },
    FlightTimesTable {
        name: "A11",
        is_long_track: true,
        method: "binpat",
        times_s: [
            &[614.0, 633.0, 577.0, 608.0, 672.0],
            &[675.0, 698.0, 690.0, 683.0, 720.0],
            &[737.0, 756.0, 698.0, 717.0, 806.0],
            &[460.0, 514.0, 462.0, 430.0, 488.0],
            &[525.0, 595.0, 549.0, 538.0, 576.0],
            &[555.0, 629.0, 558.0, 522.0, 584.0],
        ],
    },
    FlightTimesTable {
        name: "A12",
        is_long_track: true,
        method: "powell-binpat",
        times_s: [
            &[560.0, 602.0, 614.0, 557.0, 645.0],
            &[634.0, 654.0, 720.0, 659.0, 709.0],
            &[675.0, 774.0, 704.0, 733.0, 789.0],
            &[489.0, 531.0, 501.0, 502.0, 532.0],
            &[556.0, 571.0, 528.0, 552.0, 582.0],
            &[591.0, 619.0, 579.0, 592.0, 627.0],
        ],
    },
];

/// Table 2: distance costs of three vehicles, metres, by method.
pub(super) const TABLE_2_COSTS_M: [[f64; 3]; 3] =
    [[963.81, 944.65, 644.58], [928.75, 900.34, 789.27], [908.75, 911.77, 904.72]];

/// Table 3: planning times, seconds, by method, for 2 to 7 vehicles.
pub(super) const PAPER_PLANNING_TIMES_S: [[f64; 6]; 3] = [
    [0.000748, 0.001474, 0.001522, 0.001961, 0.003479, 0.004275],
    [0.0021, 0.002244, 0.002756, 0.003125, 0.003365, 0.003924],
    [0.296894, 0.301134, 0.512768, 1.419654, 1.853162, 1.96757],
];

/// Table 4: distance costs, metres: BINPAT, then POWELL, which leaves the first vehicle on the
/// ground.
pub(super) const TABLE_4_COSTS_M: [[f64; 3]; 2] = [[390.72, 401.93, 394.62], [0.0, 370.73, 383.99]];

/// Table 5: mean over the cases of the largest flight time in a fleet, seconds: short and long
/// track, by method.
pub(super) const MEAN_LARGEST_TIME_S: [[f64; 3]; 2] =
    [[300.42, 330.08, 322.0], [795.58, 754.25, 735.42]];

/// Table 6: flight times of three real vehicles, seconds, by method.
pub(super) const REAL_FLIGHT_TIMES_S: [[f64; 3]; 3] =
    [[289.0, 305.0, 276.0], [279.0, 298.0, 268.0], [285.0, 282.0, 271.0]];
