"use strict";
// Plays the films of a page. A film's data: points in 1/10000 of its size about its middle, one list for each frame;
// parts [kind, indices of points, colour, width, corners of a solid, box or mesh in the frame of its points, faces of a mesh]; fixed polylines. Seen from (elevation, azimuth); depth orders the parts.
for (const box of document.querySelectorAll(".film")) {
  const film = JSON.parse(box.querySelector("script").textContent);
  const canvas = box.querySelector("canvas"), pen = canvas.getContext("2d");
  const play = box.querySelector("button"), scrub = box.querySelector("input"), pace = box.querySelector("select");
  const shown = box.querySelector("output");
  const dims = film.planar ? 2 : 3, end = film.time[film.time.length - 1];
  let [elevation, azimuth] = film.view.map((angle) => angle * Math.PI / 180);
  let t = 0, playing = false, before = 0;
  for (const speed of film.speeds) pace.add(new Option(`${speed} ×`, speed, speed === film.speed, speed === film.speed));
  scrub.max = end; scrub.step = "any";

  function points(time) {  // of the two frames about a time, the line between them
    let k = 0;
    while (k < film.time.length - 2 && film.time[k + 1] <= time) k++;
    const a = film.frames[k], b = film.frames[Math.min(k + 1, film.frames.length - 1)];
    const step = (film.time[k + 1] ?? 0) - film.time[k];
    const part = step > 0 ? Math.min(Math.max((time - film.time[k]) / step, 0), 1) : 0;
    return a.map((value, i) => value + part * (b[i] - value));
  }

  function projection() {  // to [right, down, depth, depth in px] on the canvas
    const [w, h] = [canvas.clientWidth, canvas.clientHeight];
    const [ce, se, ca, sa] = [Math.cos(elevation), Math.sin(elevation), Math.cos(azimuth), Math.sin(azimuth)];
    const seen = film.planar ? (x, y) => [x, y, 0]
      : (x, y, z) => [-sa * x + ca * y, -se * (ca * x + sa * y) + ce * z, ce * (ca * x + sa * y) + se * z];
    let [width, height] = [0, 0];  // room for all corners of what is drawn
    for (let corner = 0; corner < 8; corner++) {
      const [x, y] = seen(...[0, 1, 2].map((axis) => (corner >> axis & 1 ? film.high : film.low)[axis]));
      [width, height] = [Math.max(width, Math.abs(x)), Math.max(height, Math.abs(y))];
    }
    const scale = Math.min((w - 40) / (2 * width || 1), (h - 40) / (2 * height || 1));
    return (values, i) => {
      const [x, y, z] = seen(...values.slice(dims * i, dims * i + dims));
      return [w / 2 + scale * x, h / 2 - scale * y, z, scale * z];
    };
  }

  function corners(values, indices, local) {  // of a solid: origin + sum of local coordinates times axes
    const [origin, ...axes] = indices.map((i) => values.slice(dims * i, dims * i + dims));
    return Array.from({ length: local.length / 3 }, (_, k) =>
      origin.map((start, d) => axes.reduce((sum, axis, j) => sum + local[3 * k + j] * (axis[d] - start), start)));
  }

  function outline(spots) {  // the convex hull of points on the canvas
    const half = (sorted) => sorted.reduce((chain, point) => {
      const left = (a, b) => (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
      while (chain.length > 1 && left(chain.at(-2), chain.at(-1)) <= 0) chain.pop();
      return [...chain, point];
    }, []).slice(0, -1);
    const sorted = [...spots].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    return [...half(sorted), ...half(sorted.reverse())];
  }

  function stroke(line, colour, width) {
    pen.beginPath();
    line.forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
    [pen.strokeStyle, pen.lineWidth] = [colour, width];
    pen.stroke();
  }

  let strength = 1;  // of what is drawn: less of a motion that is laid over
  const draw = {
    face(line, colour) {
      stroke([...line, line[0]], "#1f2933", 1.2);
      [pen.fillStyle, pen.globalAlpha] = [colour, strength * (film.planar ? 1 : 0.6)];
      pen.fill();
      pen.globalAlpha = strength;
    },
    solid(spots, colour, width) {
      const line = outline(spots);
      stroke([...line, line[0]], "#1f2933", width);
      pen.fillStyle = colour; pen.fill();
    },
    mesh(spots, colour, width, faces) {  // its triangles that face the eye, the nearer on top, the brighter the more they do
      const base = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16)), seen = [];
      for (let k = 0; k < faces.length; k += 3) {
        const [a, b, c] = [0, 1, 2].map((j) => spots[faces[k + j]]);
        const [u, v] = [b, c].map((p) => p.map((value, d) => value - a[d]));
        const across = u[0] * v[1] - u[1] * v[0];
        if (across >= 0) continue;
        const normal = Math.hypot(u[1] * v[3] - u[3] * v[1], u[3] * v[0] - u[0] * v[3], across);
        seen.push([a, b, c, a[2] + b[2] + c[2], 0.55 - 0.45 * across / normal]);
      }
      seen.sort((one, other) => one[3] - other[3]);
      for (const [a, b, c, , light] of seen) {
        pen.fillStyle = `rgb(${base.map((value) => Math.round(value * light)).join(",")})`;
        stroke([a, b, c, a], pen.fillStyle, 0.6);
        pen.fill();
      }
    },
    bar(line, colour, width) { stroke(line, "#1f2933", width + 2); stroke(line, colour, width); },
    line: stroke,
    dashes(line, colour, width) { pen.setLineDash([4, 3]); stroke(line, colour, width); pen.setLineDash([]); },
    spring([[x, y], [u, v]], colour, width) {
      const [dx, dy, turns] = [u - x, v - y, 12], length = Math.hypot(dx, dy) || 1;
      const zigzag = [[x, y], [x + 0.2 * dx, y + 0.2 * dy]];
      for (let i = 1; i < turns; i++) {
        const [s, side] = [0.2 + 0.6 * i / turns, (i % 2 ? 5 : -5) / length];
        zigzag.push([x + s * dx - side * dy, y + s * dy + side * dx]);
      }
      stroke([...zigzag, [u - 0.2 * dx, v - 0.2 * dy], [u, v]], colour, width);
    },
    dot([[x, y]], colour, width) {
      pen.beginPath(); pen.arc(x, y, width, 0, 2 * Math.PI);
      [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [colour, "#1f2933", 1.5];
      pen.fill(); pen.stroke();
    },
    box(spots, colour, width) { draw.solid(spots, colour, width); },
    ground(spots, colour) {
      const line = outline(spots);
      stroke([...line, line[0]], "#7b8794", 0.8);
      [pen.fillStyle, pen.globalAlpha] = [colour, 0.5];
      pen.fill();
      pen.globalAlpha = 1;
    },
  };

  function paint() {
    const sharp = window.devicePixelRatio || 1;
    canvas.width = sharp * canvas.clientWidth; canvas.height = sharp * canvas.clientHeight;
    pen.setTransform(sharp, 0, 0, sharp, 0, 0);
    [pen.lineCap, pen.lineJoin] = ["round", "round"];
    const place = projection(), values = points(t);
    for (const [kind, line, colour, width] of film.fixed)
      draw[kind](Array.from({ length: line.length / dims }, (_, i) => place(line, i)), colour, width);
    const level = { dot: 2e3, box: 2e3, line: 4e3 };  // joints and axes stand a little above bodies
    const parts = film.parts.map(([kind, indices, colour, width, local, faces, faint], order) => {
      const line = local.length ? corners(values, indices, local).map((point) => place(point, 0))
        : indices.map((i) => place(values, i));
      const depth = line.reduce((sum, point) => sum + point[2], 0) / line.length + (level[kind] ?? 0);
      return { kind, line, colour, width, faces, faint, depth, order };
    });
    if (!film.planar) parts.sort((a, b) => a.depth - b.depth || a.order - b.order);
    for (const { kind, line, colour, width, faces, faint } of parts) {
      pen.globalAlpha = strength = faint ? 0.3 : 1;
      draw[kind](line, colour, width, faces);
    }
    pen.globalAlpha = strength = 1;
    scrub.value = t;
    shown.textContent = `${(film.start + t).toFixed(3)} s`;
    box.dataset.time = t;
  }

  function run(now) {
    if (!playing) return;
    t += (now - before) / 1000 * Number(pace.value);
    before = now;
    if (t > end) t = t < end + 0.8 * Number(pace.value) ? t : 0;  // rest a moment at the end
    const rest = t;
    t = Math.min(t, end); paint(); t = rest;
    requestAnimationFrame(run);
  }

  function set(on) {
    playing = on;
    play.textContent = on ? "Pause" : "Play";
    if (!on) { t = Math.min(t, end); return; }
    if (t >= end) t = 0;
    before = performance.now();
    requestAnimationFrame(run);
  }

  play.onclick = () => set(!playing);
  scrub.oninput = () => { set(false); t = Number(scrub.value); paint(); };
  if (!film.planar) {
    canvas.classList.add("turned");
    canvas.onpointerdown = (event) => canvas.setPointerCapture(event.pointerId);
    canvas.onpointermove = (event) => {
      if (!event.buttons) return;
      azimuth -= event.movementX / 150;
      elevation = Math.min(Math.max(elevation + event.movementY / 150, -1.5), 1.5);
      paint();
    };
  }
  new ResizeObserver(paint).observe(canvas);
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) set(true);
}
