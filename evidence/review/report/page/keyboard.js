// SPDX-License-Identifier: Apache-2.0
// One table of keys: what they do, and what the help says.
takt.keyboard = function (view, violations, marks) {
  const help = document.getElementById('help');
  const keys = [
    [' ', 'space', 'play or pause', () => view.play(!view.isPlaying)],
    ['ArrowLeft', '←', 'cursor back', () => view.step(-1)],
    ['ArrowRight', '→', 'cursor on', () => view.step(1)],
    ['n', 'n', 'next violation', () => violations.next()],
    ['p', 'p', 'previous violation', () => violations.previous()],
    ['m', 'm', 'next mark', () => marks.next()],
    ['M', 'M', 'previous mark', () => marks.previous()],
    ['+', '+', 'zoom in, about the cursor', () => view.zoom(0.5)],
    ['-', '-', 'zoom out', () => view.zoom(2)],
    ['0', '0', 'the whole run', () => view.whole()],
    ['d', 'd', 'dark or light', () => takt.theme.toggle()],
    ['?', '?', 'this help', () => (help.open ? help.close() : help.showModal())],
  ];
  document.getElementById('keys').append(...keys.map(([, label, meaning]) => takt.row([label, meaning])));
  document.getElementById('help-open').addEventListener('click', () => help.showModal());
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest('select')) return;
    if (event.key === ' ' && event.target.closest('button')) return;  // presses it
    if (help.open && event.key !== '?') return;
    const key = keys.find(([name]) => name === (event.key === '=' ? '+' : event.key));
    if (!key) return;
    event.preventDefault();
    key[3]();
  });
};
