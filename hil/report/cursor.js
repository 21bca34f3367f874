// One cursor for all plots: pointing at a time in any of them reads every curve at that time.
"use strict";
(() => {
  const plots = [...document.querySelectorAll(".plot svg[data-x]")].map((svg) => {
    const [start, end, left, right] = svg.dataset.x.split(" ").map(Number);
    const curves = [...svg.parentNode.querySelectorAll("[data-curve]")].map((item) => ({
      output: item.querySelector("output"),
      values: item.dataset.curve.split(","),
    }));
    return { svg, start, end, left, right, curves, cursor: svg.querySelector(".cursor") };
  });
  let now = null;

  function show(time) {
    now = time;
    for (const p of plots) {
      const share = time === null ? NaN : (time - p.start) / (p.end - p.start);
      const inside = share >= 0 && share <= 1;
      const x = inside ? p.left + share * (p.right - p.left) : -9;
      p.cursor.setAttribute("x1", x);
      p.cursor.setAttribute("x2", x);
      for (const { output, values } of p.curves) {
        const word = inside ? values[Math.round(share * (values.length - 1))] : "";
        output.textContent = word ? word.replace("-", "\u2212") : "";
      }
      p.svg.setAttribute("aria-description", inside ? `cursor at ${time.toFixed(2)} s` : "");
    }
  }

  for (const p of plots) {
    const timeAt = (event) => {
      const box = p.svg.getBoundingClientRect();
      const x = ((event.clientX - box.left) / box.width) * p.svg.viewBox.baseVal.width;
      return p.start + ((x - p.left) / (p.right - p.left)) * (p.end - p.start);
    };
    p.svg.addEventListener("pointermove", (event) => show(timeAt(event)));
    p.svg.addEventListener("pointerleave", () => show(null));
    p.svg.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 }[event.key];
      if (event.key === "Escape") show(null);
      if (step === undefined) return;
      event.preventDefault();
      const from = now === null ? p.start : now;
      show(Math.min(p.end, Math.max(p.start, from + (step * (p.end - p.start)) / 100)));
    });
  }
})();
