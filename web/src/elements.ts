/** Elements of the page. Texts are set as text, never as markup. */
type Attributes = Record<string, string>;

export function make<Name extends keyof HTMLElementTagNameMap>(name: Name, attributes: Attributes = {}, ...content: (Node | string)[]): HTMLElementTagNameMap[Name] {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...content);
  return element;
}

/** A checkbox in its label; `swatch` is a colour shown beside it. */
export function checkbox(id: string, text: string, checked: boolean, swatch: string | null, changed: (checked: boolean) => void): HTMLLabelElement {
  const box = make('input', { type: 'checkbox', id });
  box.checked = checked;
  box.addEventListener('change', () => changed(box.checked));
  const label = make('label', {}, box);
  if (swatch) {
    const sample = make('span', { class: 'view-swatch', 'aria-hidden': 'true' });
    sample.style.background = swatch;
    label.append(sample);
  }
  label.append(text);
  return label;
}

/** One of several; the first is chosen. */
export function choice<Value extends string>(name: string, title: string, options: [Value, string][], changed: (value: Value) => void): HTMLFieldSetElement {
  const group = make('fieldset', {}, make('legend', {}, title));
  options.forEach(([value, text], i) => {
    const box = make('input', { type: 'radio', name, value, id: `${name}-${value}` });
    box.checked = i === 0;
    box.addEventListener('change', () => box.checked && changed(value));
    group.append(make('label', {}, box, text));
  });
  return group;
}

export function button(id: string, text: string, pressed: () => void): HTMLButtonElement {
  const element = make('button', { type: 'button', id }, text);
  element.addEventListener('click', pressed);
  return element;
}

/** 12.3 with a true minus sign. */
export function number(value: number, decimals: number): string {
  return value.toFixed(decimals).replace('-', '\u2212');
}
