// The script of the report: the slider over the moments of the run, and the values of curves under
// the pointer. All data are in the page; see section.rs and report/player.rs for their form.
'use strict';
(() => {
  const bytes = text => Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  // numbers from 0 to 65535, the lower byte first
  const places = text => {
    const view = new DataView(bytes(text).buffer);
    return Array.from({ length: view.byteLength / 2 }, (_, k) => view.getUint16(2 * k, true));
  };
  const MOST = 65535;
  // A number with the digits that are right to `step`.
  const number = (value, step) => {
    const unit = 10 ** Math.ceil(Math.log10(step || Math.abs(value) * 1e-4 || 1));
    const rounded = Number((Math.round(value / unit) * unit).toPrecision(10)), size = Math.abs(rounded);
    return size && (size < 1e-3 || size >= 1e6) ? rounded.toExponential().replace('e+', 'e') : String(rounded);
  };
  // A time of the run in words; in a run from break to break it counts steps.
  const per_step = Number(document.body.dataset.step);
  const when = time => (per_step ? `step ${Math.round(time / per_step)}` : `t = ${number(time)} s`);
  const element = (name, kind, parent) => {
    const made = document.createElement(name);
    made.className = kind;
    parent.append(made);
    return made;
  };

  // The charts: a line or a dot at the moment of the slider, values under the pointer.
  const charts = [];
  for (const figure of document.querySelectorAll('figure.chart')) {
    const data = figure.querySelector('script');
    if (!data) continue;
    const { area, x, y, log, whole, titles, time, curves } = JSON.parse(data.textContent);
    const [left, top, right, bottom] = area;
    for (const curve of curves) curve.places = places(curve.points);
    const box = figure.querySelector('.plot');
    const line = element('i', 'cursor', box), now = element('i', 'dot', box);
    const dot = element('i', 'dot', box), tip = element('output', 'tip', box);
    const value = ([low, high], place, logarithmic, whole) => {
      const share = place / MOST;
      if (!logarithmic) return number(low + share * (high - low), Math.max(whole ? 1 : 0, Math.abs(high - low) / MOST));
      const found = low * (high / low) ** share;
      return number(found, Math.max(found * Math.log(high / low) / MOST, 1e-4 * found));
    };
    const move = (mark, u, v, colour) => {
      mark.style.left = `${100 * (left + (right - left) * u / MOST)}%`;
      mark.style.top = `${100 * (bottom + (top - bottom) * v / MOST)}%`;
      if (colour) mark.style.background = colour;
      mark.style.display = 'block';
    };
    const hide = () => { dot.style.display = tip.style.display = 'none'; };
    box.addEventListener('pointermove', event => {
      const frame = box.getBoundingClientRect();
      const u = ((event.clientX - frame.left) / frame.width - left) / (right - left) * MOST;
      const v = ((event.clientY - frame.top) / frame.height - bottom) / (top - bottom) * MOST;
      if (Math.min(u, v) < -3000 || Math.max(u, v) > MOST + 3000) return hide();
      let best = null;
      for (const curve of curves) {
        for (let k = 0; k < curve.places.length; k += 2) {
          const off = (curve.places[k] - u) ** 2 + 0.25 * (curve.places[k + 1] - v) ** 2;
          if (!best || off < best.off) best = { off, curve, k };
        }
      }
      if (!best) return hide();
      const { curve, k } = best, at = [curve.places[k], curve.places[k + 1]];
      move(dot, ...at, curve.colour);
      const name = curves.length > 1 && curve.name ? `${curve.name}\n` : '';
      const moment = curve.times.length ? `\n${when(curve.times[k / 2])}` : '';
      tip.textContent = `${name}${titles[0]}: ${value(x, at[0], log[0], false)}\n`
        + `${titles[1]}: ${value(y, at[1], log[1], whole)}${moment}`;
      // beside the point, within the picture
      move(tip, ...at);
      const [left_of, above] = [dot.offsetLeft > frame.width / 2, dot.offsetTop > frame.height / 2];
      const across = dot.offsetLeft + (left_of ? -tip.offsetWidth - 6 : 16);
      tip.style.left = `${Math.max(0, Math.min(across, frame.width - tip.offsetWidth))}px`;
      tip.style.top = `${dot.offsetTop + (above ? -tip.offsetHeight - 2 : 16)}px`;
    });
    box.addEventListener('pointerleave', hide);
    // curves of the run at a time
    const timed = curves.find(curve => curve.times.length);
    if (!time && !timed) continue;
    charts.push(moment => {
      if (time) {
        const share = (moment * time - x[0]) / (x[1] - x[0]);
        line.style.left = `${100 * (left + (right - left) * share)}%`;
        line.style.top = `${100 * top}%`;
        line.style.height = `${100 * (bottom - top)}%`;
        line.style.display = share >= 0 && share <= 1 ? 'block' : 'none';
        return;
      }
      let k = timed.times.findIndex(other => other > moment * (1 + 1e-5));
      k = k < 0 ? timed.times.length - 1 : Math.max(k - 1, 0);
      move(now, timed.places[2 * k], timed.places[2 * k + 1], 'var(--now)');
    });
  }

  // The sample.
  const source = document.getElementById('moments');
  if (!source) return;
  const run = JSON.parse(source.textContent);
  const player = document.querySelector('.player');
  const canvas = player.querySelector('canvas'), pen = canvas.getContext('2d');
  const slider = player.querySelector('input'), play = player.querySelector('button');
  const told = player.querySelector('.told');
  const d = run.dimension, grains = bytes(run.radius).length / 2, moments = run.time.length;
  const radius = places(run.radius).map(share => share / MOST * run.largest);
  const packed = places(run.position);
  const pairs = new DataView(bytes(run.pair).buffer);
  const broke = bytes(run.broke), mode = bytes(run.mode), material = bytes(run.material);
  const [west, south, east, north] = run.view;
  const margin = 0.02 * Math.max(east - west, north - south);
  const size = [east - west + 2 * margin, north - south + 2 * margin];
  let scale = 1, aside = 0, shown = 0;

  // The place of a point on the canvas, its magnification and its depth.
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const project = point => {
    let [u, v, magnified, depth] = [point[0], point[1], 1, 0];
    if (run.eye) {
      const off = point.map((x, k) => x - run.eye.focus[k]);
      depth = dot(off, run.eye.ahead);
      magnified = run.eye.far / Math.max(run.eye.far + depth, 0.2 * run.eye.far);
      [u, v] = [dot(off, run.eye.right) * magnified, dot(off, run.eye.up) * magnified];
    }
    return { x: aside + (u - west + margin) * scale, y: (north - v + margin) * scale, magnified, depth };
  };
  // A grain at a moment; none where it left the sample.
  const grain = (moment, k) => {
    const start = (moment * grains + k) * d, point = [];
    for (let axis = 0; axis < d; axis++) {
      const place = packed[start + axis];
      if (place === 0 || place === MOST) return null;
      point.push(run.low[axis] + place / MOST * (run.high[axis] - run.low[axis]));
    }
    return Object.assign(project(point), { point, k });
  };
  const colour = name => getComputedStyle(player).getPropertyValue(name).trim();

  const path = (corners, closed) => {
    pen.beginPath();
    corners.forEach(({ x, y }) => pen.lineTo(x, y));
    if (closed) pen.closePath();
  };
  const draw_wall = (wall, moment, behind) => {
    const count = wall.points.length / moments, corners = [];
    for (let k = moment * count; k < (moment + 1) * count; k += d) {
      corners.push(project(wall.points.slice(k, k + d)));
    }
    if (!corners.length) return;
    pen.strokeStyle = colour(wall.driven ? '--driven' : '--wall');
    pen.lineWidth = 2;
    if (wall.radius) {
      pen.beginPath();
      pen.arc(corners[0].x, corners[0].y, Math.abs(wall.radius) * corners[0].magnified * scale, 0, 2 * Math.PI);
      pen.fillStyle = colour('--plate');
      if (wall.radius > 0) pen.fill();
    } else {
      path(corners, d === 3);
      pen.fillStyle = colour('--plate');
      if (d === 3 && behind) pen.fill();
    }
    pen.stroke();
  };

  const draw = () => {
    const width = canvas.clientWidth, dots = window.devicePixelRatio || 1;
    if (!width) return;
    // all of a high sample is on the screen
    scale = Math.min(width / size[0], Math.max(320, 0.8 * window.innerHeight) / size[1]);
    aside = 0.5 * (width - scale * size[0]);
    const height = Math.round(scale * size[1]);
    canvas.width = Math.round(width * dots);
    canvas.height = Math.round(height * dots);
    pen.setTransform(dots, 0, 0, dots, 0, 0);
    pen.clearRect(0, 0, width, height);
    for (const wall of run.walls) if (d === 2 || wall.behind || wall.radius) draw_wall(wall, shown, true);
    const all = Array.from({ length: grains }, (_, k) => grain(shown, k));
    const released = new Uint8Array(grains);
    for (let bond = 0; bond < run.bonds; bond++) {
      if (broke[bond] > shown) continue;
      for (const side of [0, 4]) released[pairs.getInt32(8 * bond + side, true)] = 1;
    }
    const order = all.filter(one => one);
    if (d === 3) order.sort((a, b) => b.depth - a.depth);
    const paper = colour('--paper');
    const [held, free, rim, intact] = ['--grain', '--released', '--rim', '--bond'].map(colour);
    const fills = [held, ...[1, 2, 3, 4, 5].map(k => colour(`--grain-${k}`))];
    for (const one of order) {
      const size = Math.max(radius[one.k] * one.magnified * scale, 0.3);
      const disk = (fill, share, alpha) => {
        pen.globalAlpha = alpha;
        pen.beginPath();
        pen.arc(one.x - 0.25 * (1 - share) * size, one.y - 0.25 * (1 - share) * size, share * size, 0, 2 * Math.PI);
        pen.fillStyle = fill;
        pen.fill();
      };
      const own = material.length ? fills[material[one.k]] : held;
      disk(released[one.k] ? free : own, 1, 1);
      // what lost a bond keeps a tint of its material
      if (released[one.k] && material.length) disk(own, 1, 0.3);
      pen.globalAlpha = 1;
      pen.strokeStyle = rim;
      pen.lineWidth = Math.min(0.15 * size, 0.8);
      pen.stroke();
      if (run.eye) {
        disk('#ffffff', 0.5, 0.35);
        disk(paper, 1, 0.3 * (1 + Math.max(-1, Math.min(1, one.depth / run.eye.half))));
      }
    }
    pen.globalAlpha = 1;
    // bonds that hold are hidden by spheres; those whose grains have parted are left out
    const mean = radius.reduce((sum, r) => sum + r, 0) / grains;
    for (const cracks of [false, true]) {
      if (!cracks && d === 3) continue;
      pen.lineWidth = Math.min(cracks ? 3 : 1.5, Math.max(1.2 * mean * scale, 0.5));
      for (let bond = 0; bond < run.bonds; bond++) {
        if ((broke[bond] <= shown) !== cracks) continue;
        const i = pairs.getInt32(8 * bond, true), j = pairs.getInt32(8 * bond + 4, true);
        const [a, b] = [all[i], all[j]];
        if (!a || !b) continue;
        const apart = Math.hypot(...a.point.map((x, k) => x - b.point[k]));
        if (cracks && apart >= 1.5 * (radius[i] + radius[j])) continue;
        pen.strokeStyle = cracks ? run.colours[mode[bond]] : intact;
        path([a, b], false);
        pen.stroke();
      }
    }
    for (const wall of run.walls) if (d === 3 && !wall.behind && !wall.radius) draw_wall(wall, shown, false);
  };

  const show = moment => {
    shown = moment;
    slider.value = String(moment);
    const time = run.time[moment], load = run.load[moment];
    const parts = [when(time)];
    if (load !== undefined && load !== null) parts.push(`load ${number(load)} N`);
    if (run.bonds) parts.push(`${run.broken[moment]} of ${run.bonds} bonds broken`);
    if (run.outside[moment]) parts.push(`${run.outside[moment]} of ${grains} grains outside the picture`);
    told.textContent = parts.join(' · ');
    slider.setAttribute('aria-valuetext', told.textContent);
    draw();
    charts.forEach(mark => mark(time));
  };

  let timer = 0;
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    play.textContent = '▶';
    play.setAttribute('aria-label', 'Play');
  };
  play.addEventListener('click', () => {
    if (timer) return stop();
    if (shown === moments - 1) show(0);
    play.textContent = '❚❚';
    play.setAttribute('aria-label', 'Stop');
    timer = setInterval(() => (shown < moments - 1 ? show(shown + 1) : stop()), 100);
  });
  slider.addEventListener('input', () => { stop(); show(Number(slider.value)); });
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  for (const event of ['resize', 'beforeprint', 'afterprint']) window.addEventListener(event, draw);
  player.querySelector('.stage').hidden = false;
  show(run.start);
})();
