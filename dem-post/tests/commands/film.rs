//! `dem-post film`.

use super::*;

#[test]
fn a_film_is_one_animated_picture_and_a_webm_where_there_is_ffmpeg() {
    for dimension in [2, 3] {
        let (folder, path) = sample(&layout(dimension));
        let programs = folder.path().join("programs");
        std::fs::create_dir(&programs).unwrap();
        let film = |options: &[&str]| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_dem-post"));
            command.args(["film", "run.h5", "--seconds", "4", "--json"]).args(options);
            command.current_dir(path.parent().unwrap()).env("PATH", &programs).output().unwrap()
        };
        let output = film(&[]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let found = json(&output);
        // 30 ticks and the first one, and 2 s for the last picture
        assert!((found["length"].as_f64().unwrap() - (31.0 / 15.0 + 2.0)).abs() < 1e-12, "{found}");
        assert_eq!((&found["webm"], found["span"][1].as_f64()), (&false.into(), Some(0.1)));
        let shown = found["pictures"].as_array().unwrap();
        // all eleven frames; bonds break in those of steps 30 and 60, which stay longest
        assert_eq!(shown.len(), 11, "{found}");
        let ticks = |frame: usize| shown[frame]["ticks"].as_u64().unwrap();
        assert!([3, 6].iter().all(|&slow| (0..11).all(|other| [3, 6].contains(&other) || ticks(slow) > ticks(other))));
        let png = std::fs::read(folder.path().join("run-post/film.png")).unwrap();
        let chunk = png.windows(4).position(|name| name == b"acTL").expect("an animation");
        assert_eq!(png[chunk + 4..chunk + 8], [0, 0, 0, 11]);
        assert!(!folder.path().join("run-post/film.webm").exists());

        // the last argument of ffmpeg is its output
        let script = "#!/bin/sh\nfor last; do :; done\necho \"$@\" > \"$last\"\n";
        let ffmpeg = programs.join("ffmpeg");
        std::fs::write(&ffmpeg, script).unwrap();
        std::fs::set_permissions(&ffmpeg, std::os::unix::fs::PermissionsExt::from_mode(0o755)).unwrap();
        assert_eq!(json(&film(&[]))["webm"], true);
        let told = std::fs::read_to_string(folder.path().join("run-post/film.webm")).unwrap();
        assert!(told.contains("-f apng -i run-post/film.png -vf fps=15,"), "{told}");
        // one that fails leaves the picture and says why
        std::fs::write(&ffmpeg, "#!/bin/sh\necho no encoder >&2\nexit 1\n").unwrap();
        let failed = film(&[]);
        assert!(failed.status.success() && !folder.path().join("run-post/film.webm").exists());
        assert!(String::from_utf8_lossy(&failed.stderr).contains("film.webm was not made: ffmpeg: no encoder"));
    }
}
