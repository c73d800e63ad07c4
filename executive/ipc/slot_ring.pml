/* SPDX-License-Identifier: Apache-2.0 */
/* Spin model of the slot protocol in slot_ring.md: one writer, one reader, two payload words per slot, two slots.
 * Interleavings are sequentially consistent; what the orders of single stores and loads add is argued in slot_ring.md.
 *
 * Property: a payload that the reader accepts is whole and is the one that head named.
 * Wrong variants, each of which must violate it: -DNO_SECOND_LOOK, -DNO_ODD_MARK, -DANY_EVEN_VERSION.
 * Run: spin -run slot_ring.pml, or tests/executive/ipc/slot_ring_model.sh, which also runs the wrong variants. */

#define SLOTS 2
#define PUBLICATIONS 5
#define TRIES 4
#define SLOT(s) (((s) - 1) % SLOTS)

byte head = 0;
byte version[SLOTS];
byte first[SLOTS];  /* both words of payload s hold s */
byte second[SLOTS];

active proctype writer() {
  byte s = 1;
  do
  :: s <= PUBLICATIONS ->
#ifndef NO_ODD_MARK
     version[SLOT(s)] = 2 * s - 1;
#endif
     first[SLOT(s)] = s;
     second[SLOT(s)] = s;
     version[SLOT(s)] = 2 * s;
     head = s;
     s++
  :: break /* done, or killed between two publications */
  :: s <= PUBLICATIONS -> /* killed inside one */
     version[SLOT(s)] = 2 * s - 1;
     first[SLOT(s)] = s;
     break
  od
}

active proctype reader() {
  byte h, v, a, b;
  byte tries = 0;
  bool accepted;
  do
  :: tries < TRIES ->
     tries++;
     h = head;
     if
     :: h == 0 -> skip
     :: else ->
        v = version[SLOT(h)];
        accepted = (v == 2 * h);
#ifdef ANY_EVEN_VERSION
        accepted = (v % 2 == 0);
#endif
        a = first[SLOT(h)];
        b = second[SLOT(h)];
#ifndef NO_SECOND_LOOK
        accepted = accepted && (version[SLOT(h)] == v);
#endif
        assert(!accepted || (a == h && b == h));
        /* an honest slot never lags behind head */
        assert(v >= 2 * h)
     fi
  :: else -> break
  od
}
