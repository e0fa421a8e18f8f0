"use strict";
{
  const panel = document.querySelector(".living"), data = document.getElementById("living-data");
  panel.hidden = false;
  const living = new Living(panel, JSON.parse(data.textContent));
  window.emmetrope = living;
  living.draw();
}
