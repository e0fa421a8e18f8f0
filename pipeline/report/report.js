"use strict";
// Improvements of a page that is complete without them.

// Before and after, one over the other with a slider between them.
for (const figure of document.querySelectorAll("figure.compare")) {
  const pair = figure.querySelector(".pair");
  const [before, after] = pair.querySelectorAll("img");
  const slider = document.createElement("div");
  slider.className = "slider";
  slider.innerHTML = '<div class="tags"><span>Before</span><span>After</span></div><div style="position:relative"></div>' +
    '<input type="range" min="0" max="100" value="50" aria-label="Share of the picture that shows it before">';
  const stage = slider.children[1];
  const top = before.cloneNode();
  const bottom = after.cloneNode();
  top.className = "over";
  stage.append(bottom, top);
  const range = slider.querySelector("input");
  const show = () => { top.style.clipPath = `inset(0 ${100 - range.value}% 0 0)`; };
  range.addEventListener("input", show);
  show();
  pair.hidden = true;
  pair.style.display = "none";
  figure.insertBefore(slider, pair);
}

// Radiological or neurological convention of all slices.
const slices = document.querySelectorAll(".anatomical");
if (slices.length > 0) {
  const label = document.createElement("label");
  label.className = "convention";
  label.innerHTML = '<input type="checkbox"> Neurological convention (patient\'s left on the left)';
  slices[0].before(label);
  label.firstChild.addEventListener("change", (event) => {
    for (const row of slices) row.classList.toggle("neurological-view", event.target.checked);
  });
}
