const at = (id) => document.getElementById(id);
for (const [index, p] of pictures.entries()) {
  for (const side of ["left", "right"]) at(side).add(new Option(p.name, index));
  const figure = document.createElement("figure");
  for (const key of index === 0 ? ["picture"] : ["picture", "error"]) {
    const image = new Image();
    image.src = p[key];
    image.alt = `${p.name}: ${key}`;
    figure.append(image);
  }
  const caption = document.createElement("figcaption");
  caption.textContent = p.name;
  figure.append(caption);
  at("thumbs").append(figure);
}
at("left").value = Math.min(1, pictures.length - 1);
at("right").value = 0;
function show() {
  const key = at("errors").checked ? "error" : "picture";
  at("over").src = pictures[at("left").value][key];
  at("under").src = pictures[at("right").value][key];
  at("over").style.clipPath = `inset(0 ${100 - at("cut").value}% 0 0)`;
  at("bar").style.left = `${at("cut").value}%`;
}
for (const id of ["left", "right", "errors", "cut"]) at(id).addEventListener("input", show);
show();
