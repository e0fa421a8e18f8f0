"use strict";
{
  const panel = document.querySelector(".living"), data = document.getElementById("living-data");
  panel.hidden = false;
  try {
    const living = new Living(panel, JSON.parse(data.textContent));
    window.emmetrope = living;
    const controls = new Controls(living, panel);
    controls.numbers = new Numbers(living, panel);
    controls.follow();
    for (const eye of living.eyes)
      eye.canvas.addEventListener("webglcontextlost", () => living.says("The browser has taken the graphics away: load the page again."));
    controls.readLink();
    // Not before it is looked at, so that a report is there at once.
    new IntersectionObserver((entries, observer) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      living.wake();
    }, { rootMargin: "300px" }).observe(panel);
  } catch (fault) {
    for (const part of panel.querySelectorAll(".living-pictures, .living-controls, .living-numbers")) part.hidden = true;
    panel.querySelector(".living-status").textContent = `The eye cannot look out of this page: ${fault.message}.`;
  }
}
