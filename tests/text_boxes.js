// Text of a page that lies over other text, or is cut off: a list of sentences, sent to the page around.
function boxesOfText() {
  const boxes = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const parent = node.parentElement;
    if (!node.data.trim() || parent.closest("script, style, svg") || !parent.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const scrolls = parent.closest(".scroll") !== null;
    for (const r of range.getClientRects()) {
      // A line's box has the height of the font, with room above and below the letters.
      const room = 0.15 * r.height;
      boxes.push({ of: node, what: node.data.trim(), scrolls,
                   left: r.left, right: r.right, top: r.top + room, bottom: r.bottom - room });
    }
  }
  for (const text of document.querySelectorAll("svg text")) {
    if (!text.textContent.trim() || text.closest(".hoverlayer")) continue;
    const slant = /rotate\((-?[\d.]+)/.exec(text.getAttribute("transform") || "");
    // The box of a slanted text says nothing of where its letters are.
    const slanted = slant !== null && Math.abs(parseFloat(slant[1])) % 90 > 1;
    const r = text.getBoundingClientRect();
    const room = 0.15 * Math.min(r.height, r.width);
    const frame = text.closest(".svg-container");
    boxes.push({ of: text, what: text.textContent, frame: frame && frame.getBoundingClientRect(), slanted,
                 left: r.left, right: r.right, top: r.top + room, bottom: r.bottom - room });
  }
  for (const button of document.querySelectorAll(".modebar-btn")) {
    const { left, right, top, bottom } = button.getBoundingClientRect();
    const scrolls = button.closest(".scroll") !== null;
    boxes.push({ of: button, what: "zoom button", scrolls, left, right, top, bottom });
  }
  return boxes.filter((box) => box.right > box.left && box.bottom > box.top);
}

function complaints() {
  const boxes = boxesOfText().sort((a, b) => a.top - b.top);
  const found = new Set();
  const short = (text) => JSON.stringify(text.slice(0, 60));
  const enough = 2; // [px] of overlap that an eye sees
  boxes.forEach((a, i) => {
    const frame = a.frame || { left: 0, right: innerWidth };
    if (!a.scrolls && (a.left < frame.left - enough || a.right > frame.right + enough)) {
      found.add(`${short(a.what)} is cut off at the side`);
    }
    if (a.frame && (a.top < frame.top - enough || a.bottom > frame.bottom + enough)) {
      found.add(`${short(a.what)} is cut off above or below`);
    }
    for (let j = i + 1; j < boxes.length && boxes[j].top < a.bottom - enough; j += 1) {
      const b = boxes[j];
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (a.of !== b.of && !(a.slanted && b.slanted) && wide > enough && high > enough) {
        found.add(`${short(a.what)} lies over ${short(b.what)}`);
      }
    }
  });
  return [...found];
}

(async () => {
  const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const plots = document.querySelectorAll("script.plot").length > 0;
  for (let waited = 0; plots && !document.documentElement.dataset.drawn && waited < 300; waited += 1) {
    await pause(50);
  }
  await pause(500);
  const texts = boxesOfText().length;
  const buttons = [...document.querySelectorAll(".modebar-btn")].map((button) => button.dataset.title);
  parent.postMessage({ texts, buttons, found: complaints() }, "*");
})();
