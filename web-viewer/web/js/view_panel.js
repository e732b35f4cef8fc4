// The panel with section, transition, flying and freezing: its controls, and the viewer's side of them.

const find = (id) => document.getElementById(id);

/** `viewer()` is the viewer, if any; `changed` is called when the address should say something else. */
export function connectPanel(viewer, changed) {
  const section = () => {
    const axis = find("section-axis").value;
    for (const id of ["section-part", "section-flip"]) find(id).disabled = axis === "";
    viewer().section = axis && `${find("section-flip").checked ? "-" : ""}${axis},${find("section-part").value}`;
    changed();
  };
  for (const [id, type] of [["section-axis", "change"], ["section-part", "input"], ["section-flip", "change"]]) {
    find(id).addEventListener(type, section);
  }
  find("transition").addEventListener("change", (event) => {
    viewer().transition = event.target.value;
    changed();
  });
  find("fly").addEventListener("change", (event) => (viewer().flying = event.target.checked));
  find("freeze").addEventListener("change", (event) => (viewer().frozen = event.target.checked));
}

/** Shows what the viewer does. */
export function showInPanel(viewer) {
  const known = /^(-?)([xyz]),([\d.eE-]+)$/.exec(viewer.section);
  find("section-axis").value = known?.[2] ?? "";
  find("section-flip").checked = known?.[1] === "-";
  if (known) find("section-part").value = known[3];
  for (const id of ["section-part", "section-flip"]) find(id).disabled = !known;
  find("transition").value = viewer.transition;
  find("fly").checked = viewer.flying;
  find("freeze").checked = viewer.frozen;
  find("measure-button").setAttribute("aria-pressed", String(viewer.measuring));
}
