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

// Switches of all slices: neurological convention, and the bare image to judge the contours by.
const slices = document.querySelectorAll(".anatomical");
if (slices.length > 0) {
  const switches = document.createElement("p");
  switches.className = "switches";
  switches.innerHTML = '<label class="convention"><input type="checkbox"> Neurological convention (patient\'s left on the left)</label>' +
    '<label class="contours"><input type="checkbox" checked> Contours</label>';
  slices[0].before(switches);
  const on = (name, act) => switches.querySelector(`.${name} input`).addEventListener("change", (event) => {
    for (const row of slices) act(row.classList, event.target.checked);
  });
  on("convention", (classes, checked) => classes.toggle("neurological-view", checked));
  on("contours", (classes, checked) => classes.toggle("bare", !checked));
}

// The MR volume with the surfaces, where the page carries the viewer and the browser has WebGL 2. It starts when its
// section comes near, so that the page itself is there at once on a machine without a graphics processor.
const viewerData = document.getElementById("viewer-data");
if (viewerData && window.niivue) {
  const { Niivue, NVImage, NVMesh, SHOW_RENDER, MULTIPLANAR_TYPE } = window.niivue;
  const panel = document.querySelector(".viewer");
  const status = document.getElementById("viewer-status");
  const byId = (id) => document.getElementById(id);
  const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
  const solidOnly = 4;  // the layout without slices

  const start = async () => {
    if (!document.createElement("canvas").getContext("webgl2")) throw new Error("this browser has no WebGL 2");
    const { volumes, meshes } = JSON.parse(viewerData.textContent);
    const canvas = byId("viewer-canvas");
    const viewer = new Niivue({ isRadiologicalConvention: true, backColor: [0, 0, 0, 1], fontColor: [1, 0.88, 0.4, 1],
      isOrientationTextVisible: true, showAllOrientationMarkers: true, dragAndDropEnabled: false, show3Dcrosshair: true,
      meshXRay: 0.15, crosshairWidth: 0.4, sagittalNoseLeft: true, multiplanarShowRender: SHOW_RENDER.ALWAYS, multiplanarPadPixels: 16,
      multiplanarLayout: canvas.clientWidth > 700 ? MULTIPLANAR_TYPE.GRID : MULTIPLANAR_TYPE.AUTO, logLevel: "error" });
    // The 3-D view shows the surfaces alone: a rendered head would hide them and take seconds without a graphics processor.
    viewer.drawImage3D = () => {};
    // Without room, as while the page is laid out anew, the padding would leave panes of negative width.
    const leastRoom = 64;
    const draw = viewer.drawScene.bind(viewer);
    viewer.drawScene = () => (canvas.clientWidth < leastRoom || canvas.clientHeight < leastRoom ? undefined : draw());
    await viewer.attachToCanvas(canvas);
    viewer.opts.isSliceMM = true;
    const select = byId("viewer-volume");
    for (const [index, volume] of volumes.entries()) select.append(new Option(volume.name, index));

    const loaded = [];
    for (const mesh of meshes)
      loaded.push(await NVMesh.readMesh(bytesOf(mesh.data), `${mesh.name}.stl`, viewer.gl, 0.7, [...mesh.colour, 255], true));
    const showMeshes = () => {
      for (const mesh of loaded) {
        const isShown = viewer.meshes.includes(mesh);
        if (byId("viewer-meshes").checked && !isShown) viewer.addMesh(mesh);
        if (!byId("viewer-meshes").checked && isShown) viewer.removeMesh(mesh);
      }
      viewer.setMeshThicknessOn2D(0.5);
      viewer.drawScene();
    };
    const labelOpacity = () => (byId("viewer-labels").checked ? 0.3 : 0);
    const showVolume = async () => {
      while (viewer.volumes.length > 0) viewer.removeVolume(viewer.volumes[0]);
      const volume = volumes[Number(select.value)];
      viewer.addVolume(await NVImage.loadFromBase64({ base64: volume.data, name: `${volume.name}.nii.gz`, colormap: "gray" }));
      if (volume.labels)
        viewer.addVolume(await NVImage.loadFromBase64({ base64: volume.labels, name: "labels.nii.gz", colormap: "actc",
          opacity: labelOpacity() }));
      viewer.scene.crosshairPos = viewer.mm2frac(volume.start_ras_mm);
    };
    const layout = () => Number(byId("viewer-layout").value);
    const redraw = () => {
      if (viewer.volumes.length > 1) viewer.setOpacity(1, labelOpacity());
      viewer.setSliceType(layout());
    };
    await showVolume();
    showMeshes();
    redraw();
    select.addEventListener("change", async () => { await showVolume(); redraw(); });
    byId("viewer-labels").addEventListener("change", redraw);
    byId("viewer-layout").addEventListener("change", redraw);
    byId("viewer-meshes").addEventListener("change", showMeshes);
    const steps = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 0, 1], ArrowDown: [0, 0, -1],
      PageUp: [0, 1, 0], PageDown: [0, -1, 0] };
    canvas.addEventListener("keydown", (event) => {
      const step = steps[event.key];
      if (!step) return;
      event.preventDefault();
      if (layout() === solidOnly)
        viewer.setRenderAzimuthElevation(viewer.scene.renderAzimuth + 5 * step[0], viewer.scene.renderElevation + 5 * step[2]);
      else viewer.moveCrosshairInVox(...step);
    });
    const convention = document.querySelector(".convention input");
    if (convention) {
      const follow = () => viewer.setRadiologicalConvention(!convention.checked);
      convention.addEventListener("change", follow);
      follow();
    }
    status.textContent = "Drag or use the mouse wheel to move through the slices, or the arrow and page keys; drag the 3-D view to turn the eyes.";
    panel.dataset.ready = "true";
  };
  panel.hidden = false;
  new IntersectionObserver((entries, observer) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    start().catch((error) => {
      panel.querySelector(".viewer-canvas").hidden = true;
      panel.querySelector(".viewer-controls").hidden = true;
      status.textContent = `The interactive viewer cannot run here (${error.message}); the figures above show the same surfaces.`;
    });
  }, { rootMargin: "300px" }).observe(panel);
}
