// SPDX-License-Identifier: Apache-2.0
// What the policies saw: of each image sensor the newest image that was published by the cursor, as far as the page has it.
takt.images = function (seen, view) {
  const kSame = 1e-6;  // s

  function number(count, thing) { return `${count} ${thing}${count === 1 ? '' : 's'}`; }

  function leftOut({ shown, without_file, unreadable, pictures }) {
    return `This page has ${pictures.length} of ${number(shown, 'image')}` + (without_file ? `; ${without_file} recorded without a file` : '') +
      (unreadable ? `; ${number(unreadable, 'file')} lost or altered` : '');
  }

  function show(sensor) {
    const figure = document.createElement('figure'), image = new Image(), caption = document.createElement('figcaption'), note = document.createElement('figcaption');
    note.className = 'hint';
    note.textContent = leftOut(sensor);
    figure.append(image, caption, note);
    document.getElementById('cameras').append(figure);
    let drawn = null;
    view.on('cursor', update);
    update();

    function update() {
      const picture = sensor.pictures.findLast(({ published_s }) => published_s <= view.cursor + kSame) ?? null;
      const isNewest = picture && (picture.until_s === null || view.cursor + kSame < picture.until_s);
      image.hidden = !picture;
      image.classList.toggle('outdated', !isNewest);
      caption.textContent = `${sensor.sensor}: ` + (picture ? `sensed ${((view.cursor - picture.sensed_s) * 1000).toFixed(1)} ms before the cursor` + (isNewest ? '' : '; newer images are not on this page')
        : 'the page has no image before the cursor');
      if (!picture || picture === drawn) return;
      drawn = picture;
      image.alt = `${sensor.sensor}, ${picture.width} x ${picture.height}`;
      image.src = 'data:image/png;base64,' + picture.png;
    }
  }

  document.getElementById('seen').hidden = seen.length === 0;
  for (const sensor of seen) show(sensor);
};
