"use strict";
// Points at the same frame in both charts. Without this script the page lacks nothing else.
(() => {
  const { step, frames } = JSON.parse(document.getElementById("frames").textContent);
  const tip = document.getElementById("tip");
  const charts = [...document.querySelectorAll("svg.share-chart")];
  const maps = [...document.querySelectorAll("svg.path-map")];

  const mapPoint = (map, frame) => [
    Number(map.dataset.x0) + frame.x * Number(map.dataset.scale),
    Number(map.dataset.y0) - frame.y * Number(map.dataset.scale),
  ];

  function show(frame, event) {
    for (const chart of charts) {
      const { left, right, last } = chart.dataset;
      const x = Number(left) + ((right - left) * frame.index) / Math.max(1, Number(last));
      const line = chart.querySelector(".cursor");
      line.setAttribute("x1", x);
      line.setAttribute("x2", x);
      chart.classList.add("live");
    }
    for (const map of maps) {
      const [x, y] = mapPoint(map, frame);
      const dot = map.querySelector(".cursor");
      dot.setAttribute("cx", x);
      dot.setAttribute("cy", y);
      map.classList.add("live");
    }
    const share = frame.share === null ? "nothing to compare yet" : `${frame.share.toFixed(2)} % peaked`;
    tip.textContent = `frame ${frame.index}: ${share}${frame.captured ? ", captured" : ""} · ${frame.name}`;
    tip.style.display = "block";
    const box = tip.getBoundingClientRect();
    const x = Math.min(Math.max(4, event.clientX + 14), window.innerWidth - box.width - 4);
    const above = event.clientY - box.height - 14;
    tip.style.left = `${x}px`;
    tip.style.top = `${above > 4 ? above : event.clientY + 18}px`;
  }

  function hide() {
    tip.style.display = "none";
    for (const drawing of [...charts, ...maps]) drawing.classList.remove("live");
  }

  /** The pointer in the drawing's own units. */
  function place(drawing, event) {
    return new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
  }

  for (const chart of charts) {
    chart.addEventListener("pointermove", (event) => {
      const { left, right, last } = chart.dataset;
      const part = (place(chart, event).x - left) / (right - left);
      const row = Math.round((part * last) / step);
      show(frames[Math.min(frames.length - 1, Math.max(0, row))], event);
    });
  }
  for (const map of maps) {
    map.addEventListener("pointermove", (event) => {
      const { x, y } = place(map, event);
      const away = (frame) => {
        const [fx, fy] = mapPoint(map, frame);
        return Math.hypot(fx - x, fy - y);
      };
      const nearest = frames.reduce((best, frame) => (away(frame) < away(best) ? frame : best));
      if (away(nearest) < 40) show(nearest, event);
      else hide();
    });
  }
  for (const drawing of [...charts, ...maps]) {
    drawing.addEventListener("pointerleave", hide);
    drawing.addEventListener("pointercancel", hide);
  }
})();
