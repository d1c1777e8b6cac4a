// Keeps the parts of a page that carry data-live up to date: when something happens, the page is asked for again and
// these parts are exchanged. Without this script the page shows what was true when it was asked for.
'use strict';
(() => {
  const parts = () => document.querySelectorAll('[data-live]');
  const status = document.getElementById('live');
  if (!parts().length || !window.EventSource) return;
  let waiting = false;
  let told = '';
  const say = (text) => {
    if (text !== told && status) status.textContent = told = text;
  };
  const refresh = async () => {
    waiting = false;
    const answer = await fetch(location.href, { headers: { Accept: 'text/html' } });
    if (!answer.ok || answer.redirected) return;
    const fresh = new DOMParser().parseFromString(await answer.text(), 'text/html');
    for (const part of parts()) {
      const now = fresh.getElementById(part.id);
      if (!now || now.innerHTML === part.innerHTML) continue;
      const focused = part.contains(document.activeElement) ? document.activeElement.id : '';
      part.replaceWith(document.importNode(now, true));
      if (focused) document.getElementById(focused)?.focus();
    }
  };
  const soon = () => {
    if (waiting) return;
    waiting = true;
    setTimeout(() => refresh().catch(() => {}), 700);
  };
  const source = new EventSource('/api/v1/events');
  source.onopen = () => { say(' Live.'); soon(); };
  source.onerror = () => say(' Not live: the connection was lost; reconnecting.');
  for (const kind of ['job', 'stage', 'progress', 'run', 'root', 'night', 'alert', 'config', 'checked', 'file', 'fetch', 'lost']) {
    source.addEventListener(kind, soon);
  }
  addEventListener('pagehide', () => source.close());
})();
