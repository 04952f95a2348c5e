"""The only room that imports libsumo or sumolib: session, replay, export, closed loop."""
