/* Light or dark: as the system has it, or as somebody chose in this browser. */

const system = matchMedia('(prefers-color-scheme: dark)');

const stored = () => {
  try {
    return {dark: true, light: false}[localStorage.getItem('scheme')];
  } catch {
    return undefined; // storage is off
  }
};

let chosen = stored(); // whether dark; undefined follows the system

const apply = () => {
  document.documentElement.dataset.scheme = (chosen ?? system.matches) ? 'dark' : 'light';
  document.dispatchEvent(new Event('scheme'));
};

export const switchScheme = () => {
  chosen = !(chosen ?? system.matches);
  try {
    localStorage.setItem('scheme', chosen ? 'dark' : 'light');
  } catch { /* it lasts as long as the page */ }
  apply();
};

export const followScheme = () => {
  system.addEventListener('change', apply);
  apply();
};
