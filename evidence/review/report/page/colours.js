// SPDX-License-Identifier: Apache-2.0
// Colours are the style sheet's, so that the canvases follow the theme.
takt.colour = (function () {
  const known = new Map();  // of the theme
  const colour = function (name) {
    if (!known.has(name)) known.set(name, getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim());
    return known.get(name);
  };
  colour.forget = () => known.clear();
  return colour;
})();

// Hues far apart, however many joints there are.
takt.jointColour = (index) => `hsl(${(205 + 137.5 * index) % 360} 50% ${takt.theme.isDark() ? 68 : 42}%)`;
takt.partColours = ['#4e79a7', '#f28e2b', '#e15759', '#76b7b2', '#b07aa1'];
takt.busStates = [
  { name: 'up', colour: 'tracking' }, { name: 'error-passive', colour: 'degraded' },
  { name: 'bus-off', colour: 'fault_latched' }, { name: 'down', colour: 'standby' },
];

takt.theme = (function () {
  const root = document.documentElement;
  const listeners = [];
  function set(name) {
    if (root.dataset.theme === name) return;
    root.dataset.theme = name;
    takt.colour.forget();
    for (const listener of listeners) listener();
  }
  const prefersDark = matchMedia('(prefers-color-scheme: dark)');
  set(prefersDark.matches ? 'dark' : 'light');
  prefersDark.addEventListener('change', (event) => set(event.matches ? 'dark' : 'light'));
  // Paper is white.
  let onScreen = root.dataset.theme;
  addEventListener('beforeprint', () => { onScreen = root.dataset.theme; set('light'); });
  addEventListener('afterprint', () => set(onScreen));
  return {
    isDark: () => root.dataset.theme === 'dark',
    toggle: () => set(root.dataset.theme === 'dark' ? 'light' : 'dark'),
    onChange: (listener) => listeners.push(listener),
  };
})();
