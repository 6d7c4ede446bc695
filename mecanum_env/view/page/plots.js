// Curves over time on canvases.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const MARGIN = { left: 34, right: 4, top: 6, bottom: 16 };

export class Plot {
  // A caption, and curves: [{colour: CSS variable, stairs: bool, values: [], own: bool}]; own: a strip below.
  constructor(parent, title, curves) {
    this.figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    this.title = document.createElement("span");
    this.value = document.createElement("span");
    this.title.textContent = title;
    this.canvas = document.createElement("canvas");
    caption.append(this.title, this.value);
    this.figure.append(caption, this.canvas);
    parent.append(this.figure);
    this.curves = curves;
  }

  // Draw times [s] from start to end, with values within +- limit, and a mark at a time.
  draw(time, start, end, limit, mark = null, lowest = -limit) {
    const { canvas } = this;
    const scale = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
    if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
    const pen = canvas.getContext("2d");
    pen.setTransform(scale, 0, 0, scale, 0, 0);
    pen.clearRect(0, 0, width, height);
    const own = this.curves.filter((curve) => curve.own);
    const bottom = height - MARGIN.bottom;
    const split = own.length ? MARGIN.top + 0.58 * (bottom - MARGIN.top) : bottom;
    const box = { left: MARGIN.left, right: width - MARGIN.right, top: MARGIN.top, bottom: split };
    const shared = this.curves.filter((curve) => !curve.own);
    axes(pen, box, lowest, limit);
    for (const curve of shared) line(pen, box, time, curve, start, end, lowest, limit);
    if (own.length) {
      const strip = { ...box, top: split + 16, bottom };
      const most = nice(Math.max(1e-6, ...own.flatMap((curve) => curve.values.map((v) => Math.abs(v ?? 0)))));
      axes(pen, strip, -most, most);
      for (const curve of own) line(pen, strip, time, curve, start, end, -most, most);
    }
    pen.fillStyle = style("--quiet");
    pen.font = "11px system-ui, sans-serif";
    pen.textBaseline = "bottom";
    pen.textAlign = "left";
    pen.fillText(`${start.toFixed(1)} s`, box.left, height);
    pen.textAlign = "right";
    pen.fillText(`${end.toFixed(1)} s`, box.right, height);
    if (mark !== null) {
      const x = box.left + ((mark - start) / (end - start)) * (box.right - box.left);
      pen.fillStyle = style("--text");
      pen.fillRect(x, MARGIN.top, 1, bottom - MARGIN.top);
    }
  }
}

// The smallest of 1, 2, 5 times a power of ten that is at least a value.
export function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((limit) => limit >= value * 0.9999);
}

function axes(pen, box, lowest, highest) {
  pen.strokeStyle = style("--line");
  pen.lineWidth = 1;
  pen.fillStyle = style("--quiet");
  pen.font = "11px system-ui, sans-serif";
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  const values = lowest < 0 && highest > 0 && box.bottom - box.top > 40 ? [lowest, 0, highest] : [lowest, highest];
  for (const value of values) {
    const y = box.bottom - ((value - lowest) / (highest - lowest)) * (box.bottom - box.top);
    pen.beginPath();
    pen.moveTo(box.left, y);
    pen.lineTo(box.right, y);
    pen.stroke();
    pen.fillText(Number(value.toPrecision(3)).toString(), box.left - 3, y);
  }
}

function line(pen, box, time, curve, start, end, lowest, highest) {
  pen.save();
  pen.beginPath();
  pen.rect(box.left, box.top - 2, box.right - box.left, box.bottom - box.top + 4);
  pen.clip();
  pen.strokeStyle = style(curve.colour);
  pen.lineWidth = 1.7;
  pen.beginPath();
  let y = null;
  time.forEach((t, i) => {
    const value = curve.values[i];
    if (value === null || value === undefined) { y = null; return; }
    const x = box.left + ((t - start) / (end - start)) * (box.right - box.left);
    const next = box.bottom - ((value - lowest) / (highest - lowest)) * (box.bottom - box.top);
    if (y === null) pen.moveTo(x, next);
    else if (curve.stairs) { pen.lineTo(x, y); pen.lineTo(x, next); }
    else pen.lineTo(x, next);
    y = next;
  });
  pen.stroke();
  pen.restore();
}
