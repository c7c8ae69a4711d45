//! Real scans, where they are to be had, against an independent implementation.

use super::*;
use std::path::PathBuf;
use umbravox::exact::ExactField;
use umbravox::volume::{VolumeSpec, load};

/// A segment `x0 y0 z0 x1 y1 z1` (world mm) and its optical depth under each of [`over_scans`], from a Python
/// implementation (numpy and nibabel; roots by companion matrix, adaptive 12-point Gauss-Legendre).
type Answered = ([f64; 6], [f64; 4]);

const CT_AVM: [Answered; 4] = [
    (
        [-152.83, -44.01, 102.95, 176.03, 10.87, -145.15],
        [5.053152269894644, 1.7428042340348144, 1.5900028237583612, 0.8620577617537935],
    ),
    (
        [171.76, -134.26, -98.04, -89.52, 141.37, 70.73],
        [2.7889969696332684, 1.085739687770445, 1.2229579087823135, 1.8495055616987401],
    ),
    (
        [
            -1.403432846069336,
            -72.57785296440125,
            30.889999389648438,
            -1.403432846069336,
            107.65054428577423,
            30.889999389648438,
        ],
        [6.166057971538972, 2.0609171416015717, 1.794735726254501, 0.5512167332830638],
    ),
    (
        [19.54, 18.2, -11.49, -34.93, 62.88, -25.38],
        [3.8535190529946983, 1.3732381012115622, 1.11248828648452, 1.0043430834044222],
    ),
];
const CT_PITCH: [Answered; 4] = [
    (
        [64.53, 69.43, -112.8, -12.37, -125.68, 223.51],
        [11.24898405508563, 4.531660749028854, 5.718930433776871, 6.851767052195096],
    ),
    (
        [-141.93, -126.25, 125.66, 108.48, 122.88, -54.11],
        [17.45296239091929, 7.328294853965409, 10.207819362143889, 9.074380915478658],
    ),
    (
        [
            9.791740417480469,
            -115.03540968894958,
            63.19939661026001,
            9.791740417480469,
            84.39909958839417,
            4.12420129776001,
        ],
        [14.405699583269895, 5.071305418975287, 4.473413673651428, 7.860957410339048],
    ),
    (
        [13.29, 42.42, 43.42, -12.66, 31.23, -17.3],
        [20.097532186444173, 6.6898174349719515, 5.772466260492835, 2.6956441797823882],
    ),
];
const ENGINE: [Answered; 4] = [
    (
        [158.95, 159.62, 128.76, -95.89, -224.43, -147.98],
        [4.3897084776552555, 1.9588741244074401, 3.0753865372345097, 3.3335768157397476],
    ),
    (
        [-186.95, -25.07, 145.29, 257.91, -16.42, -156.44],
        [3.1996493020513284, 1.4013699392846766, 2.303765824723448, 4.126251836765232],
    ),
    (
        [-16.0, -131.0, 19.0, -16.0, 133.0, 19.0],
        [11.202057709367859, 4.463984216318152, 5.493177695320566, 8.24738725454198],
    ),
    (
        [-2.0, -5.95, 12.83, 56.1, -23.99, 22.55],
        [5.63050400103998, 2.463768151985962, 4.004235595693686, 3.253643657025547],
    ),
];

/// An opacity ramp, an extinction ramp, a jump and a comb of 20 thin peaks.
fn over_scans() -> [TransferFunction; 4] {
    let comb: Vec<_> = (0..20)
        .map(|k| 10.3 + 12.0 * f64::from(k))
        .flat_map(|c| [(c - 0.9, 0.0), (c, 1.5), (c + 0.9, 0.0)])
        .collect();
    [
        opacity(&[(60.5, 0.0), (240.0, 0.6)]),
        extinction(&[(60.5, 0.0), (240.0, 0.3)]),
        extinction(&[(120.4, 0.0), (120.4, 0.25)]),
        extinction(&comb),
    ]
}

#[test]
fn agrees_on_real_scans() {
    let folder = std::env::var_os("UMBRAVOX_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")), PathBuf::from);
    for (name, answered) in [("CT_AVM", CT_AVM), ("CT_pitch", CT_PITCH), ("engine", ENGINE)] {
        let path = folder.join(format!("{name}.nii.gz"));
        if !path.exists() {
            println!("skipped: {} is not there", path.display());
            continue;
        }
        let volume = load(&VolumeSpec::new(path.to_string_lossy())).unwrap();
        for (n, tf) in over_scans().iter().enumerate() {
            let field = ExactField::new(&volume, tf);
            for ([a, b, c, d, e, f], want) in answered {
                let got = field.optical_depth(DVec3::new(a, b, c), DVec3::new(d, e, f));
                assert_close(got, want[n], 1e-10);
            }
        }
    }
}
