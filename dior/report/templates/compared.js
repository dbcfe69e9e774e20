"use strict";
// what the index says more of this sequence, by a comparison with others: it is in compared.js, which the index wrote
(function () {
  var told = (window.compared || {})[document.querySelector("main").dataset.sequence];
  if (!told) return;
  function lit(light, one) {
    light.className = "light " + one.level;
    light.textContent = one.word;
  }
  function added(parent, name, words) {
    var element = document.createElement(name);
    element.textContent = words;
    parent.insertBefore(element, parent.firstChild);
    return element;
  }
  lit(document.querySelector("h1 .light"), told);
  told.notes.slice().reverse().forEach(function (text) {
    added(document.getElementById("notes"), "p", text).className = "note";
  });
  Array.prototype.forEach.call(document.querySelectorAll(".cell"), function (cell) {
    var one = told.cameras[cell.dataset.camera];
    if (!one) return;
    cell.className = "cell " + one.level;
    lit(cell.querySelector(".light"), one);
    one.reasons.slice().reverse().forEach(function (text) { added(cell.querySelector("ul"), "li", text).className = "reason"; });
  });
})();
