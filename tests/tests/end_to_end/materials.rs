//! Several materials in one scene, regions without bonds, and lists of bonds.

use crate::common::{Folder, SMALL, config, content, sets};
use dem_run::history::{History, RuptureMode};

/// Run a scene of `configs/` with these assignments.
fn run(scene: &str, assignments: &[&str]) -> (Folder, History) {
    let here = Folder::new();
    let history = again(&here, scene, assignments);
    (here, history)
}

fn again(here: &Folder, scene: &str, assignments: &[&str]) -> History {
    here.run_config(scene, &[&["-o", "a.h5", "--force"], &sets(assignments)[..]].concat());
    assert!(here.dem_post(&["info", "--check", "a.h5"]).succeeds().stdout.contains("sound    yes"));
    here.history("a.h5")
}

/// The assignments of the small compression.
fn small() -> Vec<&'static str> {
    SMALL.iter().copied().filter(|arg| *arg != "--set").collect()
}

/// Six grains in a row, the last pulled by 100 N/s; the last three are of another material.
const ROW: &str = r#"sample={"grains": [
    {"center": [0, 0], "radius": 2e-3}, {"center": [4e-3, 0], "radius": 2e-3}, {"center": [8e-3, 0], "radius": 2e-3},
    {"center": [12e-3, 0], "radius": 2e-3, "material": "hard"}, {"center": [16e-3, 0], "radius": 2e-3, "material": "hard"},
    {"center": [20e-3, 0], "radius": 2e-3, "material": "hard"}]}"#;
const PULL: &str = r#"grains.loads.0={"grain": 5, "force": [1, 0], "time": {"ramp": {"rate": 100}}}"#;
const HARD: &str = r#"materials.named=[{"name": "hard", "density": 5000}]"#;

#[test]
fn an_interface_breaks_at_its_own_strength() {
    // base breaks at 10 N, hard at 20 N; stress acts on 4 mm times 0.01 m
    for (interface, breaks, load) in [
        (r#"{"strength": 4}"#, &[[2, 3]][..], 4.0),
        (r#"{"stress": 2e5}"#, &[[2, 3]], 8.0),
        (r#"{"strength": 30}"#, &[[0, 1], [1, 2]], 10.0),
    ] {
        let pairs = format!(
            r#"materials.pairs=[{{"between": ["hard", "base"], "bonds": {interface}}},
               {{"between": ["hard", "hard"], "bonds": {{"strength": 20}}}}]"#
        );
        let stop = "stop.broken_fraction=0.1";
        let (_here, history) = run("two-grains.json", &[ROW, PULL, HARD, &pairs, stop, "time.end=0.3"]);
        assert_eq!(history.materials().expect("materials"), ["base", "hard"]);
        let grains = history.grains().expect("grains");
        assert_eq!(grains.material, [0, 0, 0, 1, 1, 1]);
        assert!((grains.mass[3] / grains.mass[0] - 2.0).abs() < 1e-15, "{:?}", grains.mass);
        let ruptures = history.ruptures().expect("ruptures");
        let pairs: Vec<[i32; 2]> = ruptures.iter().map(|rupture| rupture.pair).collect();
        assert!(breaks.contains(&pairs[0]) && pairs.iter().all(|pair| breaks.contains(pair)), "{pairs:?}");
        assert_eq!(ruptures[0].mode, RuptureMode::Tension);
        // the load of a step is that of its middle
        assert!((ruptures[0].time - 0.5e-4 - load / 100.0).abs() < 1.01e-4, "{} s", ruptures[0].time);
    }
}

#[test]
fn limits_of_shear_and_rolling_differ_by_pair() {
    let two = r#"sample={"grains": [{"center": [0, 0], "radius": 2e-3},
        {"center": [4e-3, 0], "radius": 2e-3, "material": "hard"}]}"#;
    let turned = r#"grains.loads.0={"grain": 1, "torque": [1e-3], "time": {"ramp": {"rate": 100}}}"#;
    let sideways = "grains.loads.0.force=[0, 1]";
    // as for `bonds.shear` and `bonds.rolling` in `teaching`; their default is the friction of the
    // pair
    for (pair, load, mode, time) in [
        (r#""bonds": {"shear": 0.2, "rolling": 0.5}"#, sideways, RuptureMode::Shear, 0.02),
        (r#""bonds": {"shear": 0.2, "rolling": 0.25}"#, turned, RuptureMode::Rolling, 0.1),
        (r#""friction": 0.1"#, sideways, RuptureMode::Shear, 0.01),
    ] {
        let pairs = format!(r#"materials.pairs=[{{"between": ["base", "hard"], {pair}}}]"#);
        let (_here, history) = run("two-grains.json", &[two, load, HARD, &pairs]);
        let rupture = &history.ruptures().expect("ruptures")[0];
        assert_eq!(rupture.mode, mode, "{pair}");
        assert!((rupture.time - time).abs() < 1.01e-4, "{pair}: {} s", rupture.time);
    }
}

/// Two bonded spheres, the first fixed, the second under a torque about the bond that grows by 0.1
/// N m a second; a bond of 10 N and 4 mm.
fn twisted(twist: &str, pair: &str) -> (Folder, History) {
    let here = Folder::new();
    let scene = format!(
        r#"{{ "dimension": 3,
            "sample": {{ "grains": [{{ "center": [0, 0, 0], "radius": 2e-3 }},
                {{ "center": [4e-3, 0, 0], "radius": 2e-3, "material": "hard" }}] }},
            "materials": {{ "density": 2500, "friction": {{ "grain_grain": 0.3, "grain_wall": 0.3 }},
                "named": [{{ "name": "hard" }}], "pairs": [{{ "between": ["hard", "base"], "bonds": {pair} }}] }},
            "bonds": {{ "strength": 10, "gap_tolerance": 1e-3 {twist} }},
            "grains": {{ "fixed": [0],
                "loads": [{{ "grain": 1, "torque": [1, 0, 0], "time": {{ "ramp": {{ "rate": 0.1 }} }} }}] }},
            "time": {{ "step": 1e-4, "end": 0.2 }}, "output": {{ "every_steps": 100 }} }}"#
    );
    here.write("scene.json", scene);
    here.dem_run(&["run", "scene.json", "-o", "a.h5", "--quiet"]).succeeds();
    let history = here.history("a.h5");
    (here, history)
}

#[test]
fn limits_of_twist_differ_by_pair_and_the_history_has_them() {
    // ξ a r_coh: 0.004 N m after 0.04 s with ξ = 0.1, twice that with 0.2
    for (twist, pair, coefficient) in [
        (r#", "twist": 0.1"#, "{}", 0.1),
        (r#", "twist": 0.1"#, r#"{ "twist": 0.2 }"#, 0.2),
        ("", r#"{ "twist": 0.2 }"#, 0.2),
        (r#", "twist": 0.1"#, r#"{ "twist": 0 }"#, 0.0),
    ] {
        let (here, history) = twisted(twist, pair);
        let own = history.bonds().expect("bonds").twist;
        assert_eq!(own, (pair != "{}").then(|| vec![coefficient]));
        let ruptures = history.ruptures().expect("ruptures");
        let why = here.dem_post(&["why", "a.h5", "0", "--json"]).json();
        if coefficient == 0.0 {
            assert!(ruptures.is_empty(), "it twists freely");
            assert_eq!(why["twist"], serde_json::Value::Null);
            continue;
        }
        assert_eq!(ruptures[0].mode, RuptureMode::Twist);
        assert!((ruptures[0].time - 0.4 * coefficient).abs() < 1.01e-4, "{pair}: {} s", ruptures[0].time);
        assert_eq!(why["twist"], coefficient);
        let parts = why["broken"]["parts"].as_array().expect("parts").clone();
        let twist = parts.iter().find(|part| part["mode"] == "TWIST").expect("its part");
        assert!((twist["utilisation"].as_f64().expect("a number") - 1.0).abs() < 1e-6, "{twist}");
        assert!(here.dem_post(&["info", "--check", "a.h5"]).succeeds().stdout.contains("sound    yes"));
    }
}

#[test]
fn strengths_scatter_by_pair() {
    let strengths = |sets: &[&str]| {
        let (_here, history) = run("compression.json", &[&small()[..], sets].concat());
        let bonds = history.bonds().expect("bonds");
        let material = history.grains().expect("grains").material;
        let of_base = bonds.pair.iter().map(|pair| pair.iter().all(|k| material.get(*k as usize) != Some(&1)));
        bonds.strength.into_iter().zip(of_base).collect::<Vec<_>>()
    };
    let pair = |scatter: &str| {
        format!(r#"materials.pairs=[{{"between": ["base", "base"], "bonds": {{"scatter": {scatter}}}}}]"#)
    };
    let weibull = r#"{"weibull": {"modulus": 4}}"#;
    let all = format!("bonds.scatter={weibull}");
    // of the only pair, it is that of the scene to the bit
    assert_eq!(strengths(&[&pair(weibull)]), strengths(&[&all]));
    // two materials: the strengths of one pair scatter, or those of all others
    let two =
        r#"materials.named=[{"name": "hard", "regions": [{"half_space": {"point": [0, 0.01], "normal": [0, 1]}}]}]"#;
    for (sets, scatters_in_base) in
        [(vec![two, &pair(weibull)], true), (vec![two, &all, &pair(r#"{"normal": {"deviation": 0}}"#)], false)]
    {
        let found = strengths(&sets);
        assert!(found.iter().any(|(_, base)| *base) && found.iter().any(|(_, base)| !base));
        let even = strengths(&[two])[0].0;
        for (strength, base) in found {
            assert_eq!(strength != even, base == scatters_in_base, "{strength} N, base {base}");
        }
    }
}

/// A region that holds all grains.
const ALL: &str = r#""regions": [{"half_space": {"point": [0, -1], "normal": [0, 1]}}]"#;

#[test]
fn a_named_material_that_fills_the_sample_is_the_only_material_to_the_bit() {
    let named = format!(r#"materials.named=[{{"name": "stone", "density": 3000, "wall_friction": 0.4, {ALL}}}]"#);
    let pairs = r#"materials.pairs=[{"between": ["stone", "stone"], "friction": 0.5,
        "bonds": {"strength": 8, "shear": 0.6, "rolling": 0.2}}]"#;
    let (_one, with) = run("compression.json", &[small(), vec![&named, pairs]].concat());
    let plain = [
        "materials.density=3000",
        "materials.friction.grain_wall=0.4",
        "materials.friction.grain_grain=0.5",
        "bonds.strength=8",
        "bonds.shear=0.6",
        "bonds.rolling=0.2",
    ];
    let (_other, without) = run("compression.json", &[small(), plain.to_vec()].concat());
    // the first part is the layout, which names the materials
    assert!(with.ruptures().expect("ruptures").len() > 20 && with.grains().expect("grains").material == [1; 60]);
    assert_eq!(with.bonds().expect("bonds"), without.bonds().expect("bonds"));
    assert_eq!(with.grains().expect("grains").mass, without.grains().expect("grains").mass);
    let parts = content(&with).into_iter().zip(content(&without)).skip(1);
    parts.for_each(|(one, other)| assert!(one == other, "{one:.300}\n{other:.300}"));
}

#[test]
fn several_materials_go_on_and_come_back_from_a_table_to_the_bit() {
    let here = Folder::new();
    let named = r#"materials.named=[{"name": "stone", "density": 3000, "wall_friction": 0.4,
        "regions": [{"ball": {"center": [7e-3, 1e-2], "radius": 5e-3}}, {"box": {"from": [0, 0], "to": [7e-3, 4e-3]}}]}]"#;
    let pairs = r#"materials.pairs=[{"between": ["stone", "base"], "friction": 0.5, "bonds": {"strength": 6}}]"#;
    let two = [small(), vec![named, pairs]].concat();
    let whole = again(&here, "compression.json", &two);
    let materials = whole.grains().expect("grains").material;
    let stones = materials.iter().filter(|material| **material == 1).count();
    assert!((10..50).contains(&stones), "{stones} grains of stone");
    let strengths = whole.bonds().expect("bonds").strength;
    assert!([6.0, 10.0].iter().all(|s| strengths.contains(s)), "{strengths:?}");
    let expected = content(&whole);

    // half of it, then the rest
    let half = ["-o", "half.h5", "--set", "time.end=0.2", "--write-sample", "sample.csv"];
    here.run_config("compression.json", &[&sets(&two)[..], &half].concat());
    here.dem_run(&["resume", "half.h5", "--until", "0.5"]).succeeds();
    assert!(content(&here.history("half.h5")) == expected, "the resumed run differs");

    // the table says which grain is of which material; no region does
    let bare = named.replace(r#""wall_friction": 0.4,"#, r#""wall_friction": 0.4"#);
    let bare = format!("{}}}]", bare.split(r#""regions""#).next().expect("start").trim_end());
    let sample = format!(r#"sample={{"file": {{"path": {:?}}}}}"#, here.path("sample.csv"));
    let table = again(&here, "compression.json", &[&sample, &bare, pairs, "walls.top.force_rate=100"]);
    assert_eq!(table.grains().expect("grains").material, materials);
    let parts = content(&table);
    // box and wall of a packed sample are those of its grains: nothing else is different
    assert!(parts[2..] == expected[2..], "the run of the table differs");
}

/// 5 rows of 12 and 11 disks of 4 mm, pressed from above.
const LATTICE: &str = r#"sample={"lattice": {"hexagonal": {"diameter": 4e-3, "rows": 5, "columns": 12}}}"#;

#[test]
fn no_bond_crosses_a_notch_and_all_others_stay() {
    let short = "time.end=1e-3";
    let (_one, whole) = run("compression.json", &[LATTICE, short]);
    // a cut of width zero through the lower half, beside the centres of the grains
    let notch = r#"bonds.absent=[{"box": {"from": [0.0231, -0.01], "to": [0.0231, 0.009]}}]"#;
    let (_other, cut) = run("compression.json", &[LATTICE, short, notch]);
    let places = whole.grain_state(0).expect("grains").position;
    let crosses = |pair: &[i32; 2]| {
        let [[ax, ay], [bx, by]] = pair.map(|k| [places[2 * k as usize], places[2 * k as usize + 1]]);
        let share = (0.0231 - ax) / (bx - ax);
        ax != bx && (0.0..=1.0).contains(&share) && ay + share * (by - ay) <= 0.009
    };
    let all = whole.bonds().expect("bonds").pair;
    let expected: Vec<[i32; 2]> = all.iter().copied().filter(|pair| !crosses(pair)).collect();
    assert!(all.len() - expected.len() >= 4, "{} of {} bonds are cut", all.len() - expected.len(), all.len());
    assert_eq!(cut.bonds().expect("bonds").pair, expected);
}

#[test]
fn a_list_of_all_bonds_is_the_scene_without_it_and_its_values_come_first() {
    let here = Folder::new();
    let scatter = r#"bonds.scatter={"weibull": {"modulus": 4}}"#;
    let scattered = [small(), vec![scatter]].concat();
    let plain = again(&here, "compression.json", &scattered);
    let (expected, bonds) = (content(&plain), plain.bonds().expect("bonds"));
    // backwards, with the grains of a pair exchanged
    let rows: String = bonds.pair.iter().rev().map(|[i, j]| format!("{j},{i}\n")).collect();
    here.write("bonds.csv", format!("i,j\n{rows}"));
    let list = format!("bonds.list={:?}", here.path("bonds.csv"));
    let listed = again(&here, "compression.json", &[&scattered[..], &[&list]].concat());
    assert!(content(&listed) == expected, "the run of the list differs");

    // a listed strength is not scattered, and the others stay as drawn for their place
    let [i, j] = bonds.pair[3];
    here.write("bonds.csv", format!("i,j,strength,shear,rolling\n{i},{j},7,0.5,0.1\n0,{},,,\n", bonds.pair[0][1]));
    let two =
        again(&here, "compression.json", &[small(), vec![&list, "time.end=1e-3"]].concat()).bonds().expect("bonds");
    assert_eq!(two.pair, [bonds.pair[0], bonds.pair[3]]);
    assert_eq!((two.strength, two.friction, two.rolling), (vec![10.0, 7.0], vec![0.3, 0.5], vec![0.3, 0.1]));
}

#[test]
fn wrong_materials_regions_and_lists_are_told_with_their_remedy() {
    let here = Folder::new();
    here.write("sample.csv", "x,y,radius,material\n0,0,2e-3,base\n4e-3,0,2e-3,stoen\n");
    here.write("bonds.csv", "i,j\n0,1\n0,2\n");
    let sample = format!(r#"sample={{"file": {{"path": {:?}}}}}"#, here.path("sample.csv"));
    let list = format!("bonds.list={:?}", here.path("bonds.csv"));
    let stone = |rest: &str| format!(r#"materials.named=[{{"name": "stone"{rest}}}]"#);
    let far = r#", "regions": [{"ball": {"center": [1, 0], "radius": 1e-3}}]"#;
    let twice = r#"materials.named=[{"name": "a", "regions": [{"half_space": {"point": [0, 0], "normal": [-1, 0]}}]},
        {"name": "b", "regions": [{"half_space": {"point": [1, 0], "normal": [-1, 0]}}]}]"#;
    for (set, code, parts) in [
        (&stone("") as &str, 2, &["materials.named.0: no grain is of stone", "give it a region"][..]),
        (&stone(far), 2, &["materials.named.0.regions.0.ball", "holds no centre", "from (0, 0) to (0.004, 0) m"]),
        (twice, 2, &["no grain is of a", "move it behind them"]),
        (&sample, 2, &["sample.csv, line 3: material is \"stoen\"", "base; materials.named"]),
        (&list, 2, &["bonds.csv, line 3: j is \"2\"", "from 0 to 1"]),
        ("bonds.list=\"nowhere.csv\"", 4, &["bonds.list", "nowhere.csv cannot be read"]),
        (
            r#"bonds.absent=[{"ball": {"center": [1, 0], "radius": 1e-3}}]"#,
            2,
            &["bonds.absent.0.ball: no bond would pass", "move or enlarge it"],
        ),
    ] {
        for command in ["run", "check"] {
            here.dem_run(&[command, &config("two-grains.json"), "--set", set]).fails(code, parts);
        }
    }
}
