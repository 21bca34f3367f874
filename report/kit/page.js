// One time cursor and one zoom for all plots, bands and films of the page.
"use strict";
(() => {
  const UNITS = 10000;
  const minus = (text) => text.replace("-", "\u2212");
  const numbers = (text) => text.split(" ").map(Number);
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];

  // A drawn path back into its stretches of points, in units of the drawing.
  function stretches(path) {
    const found = [];
    let x = 0, y = 0, points = null;
    for (const [, letter, rest] of path.getAttribute("d").matchAll(/([Mlhv])([^Mlhv]*)/g)) {
      const values = rest.trim() === "" ? [] : rest.trim().split(/\s+/).map(Number);
      if (letter === "M") { [x, y] = values; points = [[x, y]]; found.push(points); }
      else if (letter === "h") { x += values[0]; points.push([x, y]); }
      else if (letter === "v") { y += values[0]; points.push([x, y]); }
      else for (let i = 0; i < values.length; i += 2) { x += values[i]; y += values[i + 1]; points.push([x, y]); }
    }
    return found;
  }

  // The curve's level at x, or null in a gap. Steps hold; lines are read in between.
  function levelAt(curve, x) {
    const part = curve.stretches.find((p) => p[0][0] <= x && x <= p[p.length - 1][0] + 1);
    if (!part) return null;
    let low = 0, high = part.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (part[middle][0] <= x) low = middle; else high = middle - 1;
    }
    const [x0, y0] = part[low];
    if (curve.steps || low === part.length - 1) return y0;
    const [x1, y1] = part[low + 1];
    return y0 + ((y1 - y0) * (x - x0)) / (x1 - x0);
  }

  function readable(value, range) {
    const digits = Math.max(0, 2 - Math.floor(Math.log10(range / 10)));
    return minus(value.toFixed(Math.min(digits, 4)));
  }

  function roundTicks(start, end, count) {
    const rough = (end - start) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * (1 - 1e-9));
    const found = [];
    for (let n = Math.ceil(start / step - 1e-9); n * step <= end + 1e-9 * step; n++) found.push(n * step);
    return found;
  }

  function add(parent, kind) {
    const node = document.createElement("div");
    node.className = kind;
    node.hidden = true;
    parent.append(node);
    return node;
  }

  // What has a time axis: a plot, or the bands of a run.
  const charts = all(".area[data-t], .bands[data-t]").map((root) => {
    const bands = root.classList.contains("bands");
    const box = bands ? root.querySelector(".overlay") : root;
    const outer = bands ? root : root.closest("figure");
    const legend = bands ? [] : all(".legend li", outer);
    const paths = bands ? [] : all(".moving > path:not(.mark)", root);
    return {
      root, box, bands,
      whole: numbers(root.dataset.t),
      range: bands ? null : numbers(root.dataset.y),
      curves: paths.map((path, i) => ({
        name: legend[i].textContent.trim(), output: legend[i].querySelector("output"), path,
        steps: "steps" in legend[i].dataset, silent: legend[i].hidden,
      })),
      tracks: bands ? all(".band", root).filter((b) => b.querySelector(".track")).map((b) => ({
        output: b.querySelector("output"), inner: b.querySelector(".moving"), stretches: null,
      })) : [],
      moving: root.querySelector("svg .moving"), upright: root.querySelector("svg .upright"),
      ticks: outer.querySelector(".x > div"), events: all(".event", root),
      cursor: add(box, "cursor"), chosen: add(box, "chosen"),
    };
  });
  const stages = all(".stage").map((node) => ({
    node, times: numbers(node.dataset.t), columns: +node.dataset.columns, rows: +node.dataset.rows,
    start: +node.dataset.start, said: node.getAttribute("aria-label").replace(/ the machine at.*/, ""),
  }));
  const films = all(".film").map((figure) => ({
    stage: figure.querySelector(".stage"), button: figure.querySelector("button"),
    slider: figure.querySelector("input"), output: figure.querySelector("output"),
  }));
  const bar = document.querySelector(".bar");
  const now = bar.querySelector(".now");
  const whole = charts.length ? charts[0].whole : [0, 1];
  let view = [...whole];
  let at = null;

  function read(chart) {
    const words = [];
    for (const curve of chart.curves) {
      if (curve.silent) continue;
      curve.stretches ??= stretches(curve.path);
      const x = at === null ? NaN : (UNITS * (at - chart.whole[0])) / (chart.whole[1] - chart.whole[0]);
      const level = at === null ? null : levelAt(curve, x);
      const [low, high] = chart.range;
      const word = level === null ? "" : readable(high - (level / UNITS) * (high - low), high - low);
      curve.output.textContent = at !== null && level === null ? "\u2013" : word;
      if (word) words.push(`${curve.name} ${word}`);
    }
    for (const track of chart.tracks) {
      track.stretches ??= all("i", track.inner).map((bar) => ({
        from: parseFloat(bar.style.left), to: parseFloat(bar.style.left) + parseFloat(bar.style.width), word: bar.textContent.trim(),
      }));
      const share = at === null ? NaN : (100 * (at - chart.whole[0])) / (chart.whole[1] - chart.whole[0]);
      const found = track.stretches.find((s) => s.from <= share && share < s.to + 1e-6);
      track.output.textContent = found ? found.word : "";
    }
    return words.join(", ");
  }

  function show(time) {
    at = time === null ? null : Math.min(whole[1], Math.max(whole[0], time));
    const share = at === null ? -1 : (at - view[0]) / (view[1] - view[0]);
    for (const chart of charts) {
      chart.cursor.hidden = share < 0 || share > 1;
      chart.cursor.style.left = `${100 * share}%`;
      const words = read(chart);
      if (chart.root.getAttribute("role") === "slider") {
        chart.root.setAttribute("aria-valuenow", at === null ? whole[0] : at.toFixed(2));
        chart.root.setAttribute("aria-valuetext", at === null ? "no cursor" : `${at.toFixed(2)} s: ${words || "no value"}`);
      }
    }
    for (const s of stages) {
      const [first, last] = s.times;
      const count = s.columns * s.rows;
      const place = at === null ? s.start : Math.round(((at - first) / (last - first || 1)) * (count - 1));
      const frame = Math.min(count - 1, Math.max(0, place));
      const across = (100 * (frame % s.columns)) / Math.max(s.columns - 1, 1);
      const down = (100 * Math.floor(frame / s.columns)) / Math.max(s.rows - 1, 1);
      s.node.style.backgroundPosition = `${across}% ${down}%`;
      s.node.setAttribute("aria-label", `${s.said} the machine at ${(first + (frame / (count - 1)) * (last - first)).toFixed(2)} s`);
    }
    for (const f of films) {
      if (at !== null) f.slider.value = at;
      f.output.textContent = `${Number(f.slider.value).toFixed(2)} s`;
    }
    now.textContent = at === null ? "" : `t = ${at.toFixed(2)} s`;
    bar.hidden = at === null && view[1] - view[0] > 0.999 * (whole[1] - whole[0]);
  }

  function zoom(start, end) {
    const shortest = (whole[1] - whole[0]) / 200;
    const length = Math.min(whole[1] - whole[0], Math.max(end - start, shortest));
    const from = Math.min(Math.max(start, whole[0]), whole[1] - length);
    view = [from, from + length];
    const scale = (whole[1] - whole[0]) / length;
    const shift = (from - whole[0]) / (whole[1] - whole[0]);
    const percent = (t) => (100 * (t - view[0])) / length;
    const marks = roundTicks(view[0], view[1], 8);
    const digits = Math.max(0, Math.ceil(-Math.log10(marks[1] - marks[0]) - 1e-9));
    const upright = marks.map((t) => `M${Math.round(100 * percent(t))} 0v${UNITS}`).join("");
    for (const chart of charts) {
      chart.moving.setAttribute("transform", `translate(${-UNITS * shift * scale} 0) scale(${scale} 1)`);
      chart.upright.setAttribute("d", upright);
      for (const track of chart.tracks) {
        track.inner.style.width = `${100 * scale}%`;
        track.inner.style.left = `${-100 * shift * scale}%`;
      }
      chart.ticks.replaceChildren(...marks.map((t) => {
        const label = document.createElement("span");
        label.style.left = `${percent(t)}%`;
        label.textContent = minus(t.toFixed(digits));
        return label;
      }));
      for (const flag of chart.events) {
        const place = percent(Number(flag.dataset.at));
        flag.hidden = place < 0 || place > 100;
        flag.style.left = `${place}%`;
      }
    }
    bar.querySelector('[data-zoom="all"]').disabled = scale < 1.001;
    show(at);
  }

  function zoomBy(factor) {
    const middle = at !== null && at >= view[0] && at <= view[1] ? at : (view[0] + view[1]) / 2;
    zoom(middle - (middle - view[0]) / factor, middle + (view[1] - middle) / factor);
  }

  function onKey(event) {
    const length = view[1] - view[0];
    const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 }[event.key];
    if (step !== undefined) show((at ?? view[0]) + (step * length) / 100);
    else if (event.key === "Home") show(view[0]);
    else if (event.key === "End") show(view[1]);
    else if (event.key === "+" || event.key === "=") zoomBy(2);
    else if (event.key === "-") zoomBy(0.5);
    else if (event.key === "0") zoom(...whole);
    else if (event.key === "Escape") show(null);
    else return;
    event.preventDefault();
  }

  for (const chart of charts) {
    const share = (event) => {
      const box = chart.box.getBoundingClientRect();
      return Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    };
    const timeAt = (event) => view[0] + share(event) * (view[1] - view[0]);
    let grabbed = null;
    chart.root.tabIndex = 0;
    chart.root.setAttribute("role", "slider");
    chart.root.setAttribute("aria-valuemin", whole[0]);
    chart.root.setAttribute("aria-valuemax", whole[1]);
    if (chart.bands) chart.root.setAttribute("aria-label", "Time cursor over states and warnings");
    chart.root.addEventListener("keydown", onKey);
    chart.root.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button === 0) grabbed = { time: timeAt(event), share: share(event) };
    });
    chart.root.addEventListener("pointermove", (event) => {
      show(timeAt(event));
      bar.classList.toggle("left", event.clientX > window.innerWidth / 2);
      if (!grabbed) return;
      const here = share(event);
      chart.chosen.hidden = Math.abs(here - grabbed.share) < 0.01;
      chart.chosen.style.left = `${100 * Math.min(here, grabbed.share)}%`;
      chart.chosen.style.width = `${100 * Math.abs(here - grabbed.share)}%`;
      event.preventDefault();
    });
    chart.root.addEventListener("pointerup", (event) => {
      if (grabbed && Math.abs(share(event) - grabbed.share) >= 0.01) {
        const other = timeAt(event);
        zoom(Math.min(grabbed.time, other), Math.max(grabbed.time, other));
      }
      grabbed = null;
      chart.chosen.hidden = true;
    });
    chart.root.addEventListener("pointerleave", () => { grabbed = null; chart.chosen.hidden = true; });
    chart.root.addEventListener("dblclick", () => zoom(...whole));
  }

  for (const film of films) {
    let started = null;
    const end = Number(film.slider.max);
    const stop = () => { started = null; film.button.textContent = "\u25b6"; };
    const turn = (stamp) => {
      if (started === null) return;
      started.stamp ??= stamp;
      const time = started.from + (stamp - started.stamp) / 1000;
      show(Math.min(time, end));
      if (time < end) requestAnimationFrame(turn); else stop();
    };
    film.button.addEventListener("click", () => {
      if (started !== null) return stop();
      const from = Number(film.slider.value);
      started = { from: from >= end - 0.05 ? Number(film.slider.min) : from, stamp: null };
      film.button.textContent = "\u23f8";
      requestAnimationFrame(turn);
    });
    film.slider.addEventListener("input", () => { stop(); show(Number(film.slider.value)); });
    film.slider.closest(".controls").hidden = false;
  }
  for (const button of all("[data-zoom]", bar)) {
    button.addEventListener("click", () => ({ in: () => zoomBy(2), out: () => zoomBy(0.5), all: () => zoom(...whole), none: () => show(null) })[button.dataset.zoom]());
  }
  document.body.classList.add("live");
  zoom(...whole);
})();
