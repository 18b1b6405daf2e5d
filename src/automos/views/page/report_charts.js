"use strict";
/* Small curves over the scans with one cursor in common; moving it moves the map too. */
function makeCharts(place, series, atTime, onScan) {
  const svgElement = (tag, attributes) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    return made;
  };
  const W = 400, H = 92, TOP = 6, BOTTOM = 74, LEFT = 34;
  const n = series[0].values.length;
  const toX = (i) => LEFT + (n > 1 ? (i / (n - 1)) * (W - LEFT) : 0);

  function nice(most) {
    if (!(most > 0)) return 1;
    const unit = 10 ** Math.floor(Math.log10(most));
    return [1, 1.5, 2, 3, 4, 5, 8, 10].find((m) => m * unit >= most * 0.999) * unit;
  }

  const charts = series.map((one) => {
    const known = one.values.filter((value) => value !== null);
    const top = one.top || nice(known.reduce((most, value) => Math.max(most, value), 0));
    const toY = (value) => BOTTOM - (Math.min(value, top) / top) * (BOTTOM - TOP);
    const figure = Look.element("b");
    const svg = svgElement("svg", { viewBox: `0 0 ${W} ${H}`, preserveAspectRatio: "none", role: "img" });
    svg.setAttribute("aria-label", one.name);
    for (const value of [0, top / 2, top]) {
      const y = toY(value);
      svg.append(svgElement("line", { x1: LEFT, x2: W, y1: y, y2: y, stroke: "#e8ecee", "vector-effect": "non-scaling-stroke" }));
    }
    let run = [];
    const flush = () => {
      if (!run.length) return;
      const dots = run.map((i) => `${toX(i).toFixed(1)},${toY(one.values[i]).toFixed(1)}`);
      const area = `M${toX(run[0])},${BOTTOM} L${dots.join(" L")} L${toX(run[run.length - 1])},${BOTTOM} Z`;
      svg.append(svgElement("path", { d: area, fill: one.color, opacity: 0.14 }));
      svg.append(svgElement("path", {
        d: `M${dots.join(" L")}`, fill: "none", stroke: one.color, "stroke-width": 1.6, "vector-effect": "non-scaling-stroke",
      }));
      run = [];
    };
    one.values.forEach((value, i) => (value === null ? flush() : run.push(i)));
    flush();
    const cursor = svgElement("line", { y1: TOP, y2: BOTTOM, stroke: "#20262c", "vector-effect": "non-scaling-stroke" });
    svg.append(cursor);
    const seek = (event) => {
      const frame = svg.getBoundingClientRect();
      const x = ((event.clientX - frame.left) / frame.width) * W;
      onScan(Math.round(Math.min(Math.max((x - LEFT) / (W - LEFT), 0), 1) * (n - 1)));
    };
    svg.addEventListener("pointermove", seek);
    svg.addEventListener("pointerdown", seek);
    const name = Look.element("div", { class: "name" }, Look.element("span", {}, one.name), figure);
    const chart = Look.element("div", { class: "chart" }, name, svg);
    place.append(chart);
    return { one, cursor, figure, svg, top, toY };
  });

  /* Text in a stretched SVG would be stretched too: it is written again, unstretched, whenever the width changes. */
  function writeAxes() {
    charts.forEach(({ one, svg, top, toY }, k) => {
      svg.querySelectorAll("text").forEach((text) => text.remove());
      const stretch = (svg.clientWidth || W) / W;
      const write = (text, x, y, anchor) => {
        const made = svgElement("text", { x: 0, y: 0, "text-anchor": anchor, transform: `translate(${x} ${y}) scale(${1 / stretch} 1)` });
        made.textContent = text;
        svg.append(made);
      };
      for (const value of [0, top]) write(one.axis(value), LEFT - 6 / stretch, toY(value) + 4, "end");
      if (k === charts.length - 1) {
        write(atTime(0), LEFT, H - 4, "start");
        write(atTime(n - 1), W, H - 4, "end");
      }
    });
  }
  new ResizeObserver(writeAxes).observe(place);
  writeAxes();

  return {
    show(index) {
      for (const { one, cursor, figure } of charts) {
        cursor.setAttribute("x1", toX(index));
        cursor.setAttribute("x2", toX(index));
        figure.textContent = one.values[index] === null ? "–" : one.figure(one.values[index]);
      }
    },
  };
}
