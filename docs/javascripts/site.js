"use strict";
// What the theme leaves out for people without a mouse or without sight: a name for the search's
// dialog, and a stop for Tab at whatever scrolls by itself.

(function () {
  const SCROLLS = ".md-typeset__scrollwrap, .highlight-ipynb, .md-search-result pre > code, .highlight pre > code";

  function aid() {
    document.querySelector(".md-search")?.setAttribute("aria-label", "Search");
    for (const one of document.querySelectorAll(SCROLLS)) {
      if (one.scrollWidth > one.clientWidth) one.tabIndex = 0;
    }
  }

  addEventListener("load", aid);
  addEventListener("resize", aid);
  document.querySelector(".md-search")?.addEventListener("input", () => setTimeout(aid, 500));
})();
