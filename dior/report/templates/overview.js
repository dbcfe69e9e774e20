"use strict";
// sort, filter and unfold the table of cameras; without it all of the table is shown
(function () {
  var table = document.getElementById("overview");
  var bodies = Array.prototype.slice.call(table.tBodies);
  var order = ["bad", "look", "good", "none"];

  function unfold(body, open) {
    Array.prototype.forEach.call(body.querySelectorAll("tr.recording"), function (row) { row.hidden = !open; });
    var button = body.querySelector("button.more");
    if (button) button.setAttribute("aria-expanded", String(open));
  }
  bodies.forEach(function (body) {
    unfold(body, false);
    var button = body.querySelector("button.more");
    if (button) button.addEventListener("click", function () {
      unfold(body, button.getAttribute("aria-expanded") !== "true");
    });
  });
  window.addEventListener("beforeprint", function () { bodies.forEach(function (body) { unfold(body, true); }); });

  function key(body, column) {
    if (column === 0) return body.dataset.name;
    var cell = body.rows[0].cells[column];
    if (cell.dataset.by === undefined) return order.indexOf(body.dataset.level);
    return cell.dataset.by === "" ? Infinity : Number(cell.dataset.by.replace("inf", "Infinity"));
  }
  Array.prototype.forEach.call(table.tHead.rows[0].cells, function (head, column) {
    var button = document.createElement("button");
    button.type = "button";
    while (head.firstChild) button.appendChild(head.firstChild);
    head.appendChild(button);
    button.addEventListener("click", function () {
      var descending = head.getAttribute("aria-sort") === "ascending";
      Array.prototype.forEach.call(table.tHead.rows[0].cells, function (one) { one.removeAttribute("aria-sort"); });
      head.setAttribute("aria-sort", descending ? "descending" : "ascending");
      bodies.map(function (body, i) { return [key(body, column), i, body]; }).sort(function (a, b) {
        var first = a[0] < b[0] ? -1 : a[0] > b[0] ? 1 : 0;
        return (descending ? -first : first) || a[1] - b[1];
      }).forEach(function (one) { table.appendChild(one[2]); });
    });
  });

  var tools = document.getElementById("overview-tools");
  tools.hidden = false;
  var words = tools.querySelector("input[type=search]"), wrong = tools.querySelector("input[type=checkbox]");
  function filter() {
    var word = words.value.trim().toLowerCase();
    bodies.forEach(function (body) {
      var named = !word || body.textContent.toLowerCase().indexOf(word) >= 0;
      body.hidden = !named || (wrong.checked && body.dataset.level === "good");
    });
  }
  words.addEventListener("input", filter);
  wrong.addEventListener("change", filter);
})();
