"use strict";
(function () {
  var figures = JSON.parse(document.getElementById("figures").textContent);
  var dark = window.matchMedia("(prefers-color-scheme: dark)");
  var options = { responsive: true, displaylogo: false, displayModeBar: false, scrollZoom: false };

  function theme(isDark) {
    return isDark
      ? { text: "#c9d1dc", grid: "#2e3540", line: "#4a5361", hover: "#262c35" }
      : { text: "#333a45", grid: "#e6e9ee", line: "#b4bbc6", hover: "#ffffff" };
  }

  function axisLook(axis, look) {
    return Object.assign({ gridcolor: look.grid, linecolor: look.line, zerolinecolor: look.line }, axis);
  }

  // The page's colours go under what a figure asks for itself.
  function themed(layout, isDark) {
    var look = theme(isDark), copy = JSON.parse(JSON.stringify(layout));
    copy.paper_bgcolor = "rgba(0,0,0,0)";
    copy.plot_bgcolor = "rgba(0,0,0,0)";
    copy.font = { family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 12, color: look.text };
    copy.hoverlabel = { bgcolor: look.hover, bordercolor: look.line, font: { color: look.text } };
    copy.xaxis = axisLook(copy.xaxis || {}, look);
    copy.yaxis = axisLook(copy.yaxis || {}, look);
    if (copy.yaxis2) copy.yaxis2 = axisLook(copy.yaxis2, look);
    if (copy.scene) {
      ["xaxis", "yaxis", "zaxis"].forEach(function (name) { copy.scene[name] = axisLook(copy.scene[name], look); });
    }
    return copy;
  }

  function canTurn() {
    try {
      var canvas = document.createElement("canvas");
      return !!(canvas.getContext("webgl") || canvas.getContext("experimental-webgl"));
    } catch (error) { return false; }
  }
  var turns = canTurn();

  function draw(isDark) {
    figures.forEach(function (figure) {
      var plot = figure.fallback && !turns ? figure.fallback : figure;
      var place = document.getElementById(figure.name);
      place.style.height = plot.layout.height + "px";
      Plotly.react(place, plot.data, themed(plot.layout, isDark), options);
    });
  }

  draw(dark.matches);
  dark.addEventListener("change", function (event) { draw(event.matches); });
  window.addEventListener("beforeprint", function () { draw(false); });
  window.addEventListener("afterprint", function () { draw(dark.matches); });
})();
