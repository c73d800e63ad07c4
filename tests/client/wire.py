# SPDX-License-Identifier: Apache-2.0
"""A way to a server that a test can make a bad one."""
import socket
import threading


class Wire:
    """What is sent while it is cut (`whole` is clear), and no hang-up either, arrives when it is whole again, as TCP has it. While `dribbles`
    is set, one byte a second arrives of what the server sends.
    """

    def __init__(self, server):
        self.server, self.whole, self.dribbles, self.over = server, threading.Event(), threading.Event(), threading.Event()
        self.whole.set()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = server.url.replace(str(server.port), str(self.listener.getsockname()[1]))
        self.ends = []
        self.threads = [threading.Thread(target=self._accept)]
        self.threads[0].start()

    def _accept(self):
        while not self.over.is_set():
            try:
                near, _ = self.listener.accept()
                far = socket.create_connection(("127.0.0.1", self.server.port))
            except OSError:
                return
            self.ends += [near, far]
            for source, sink, is_slow in ((near, far, False), (far, near, True)):
                self.threads.append(threading.Thread(target=self._carry, args=(source, sink, is_slow)))
                self.threads[-1].start()

    def _carry(self, source, sink, is_slow):
        source.settimeout(0.1)
        while not self.over.is_set():
            try:
                data = source.recv(65536)
                while not self.whole.wait(0.1) and not self.over.is_set():
                    pass
                while is_slow and data and self.dribbles.is_set():
                    sink.sendall(data[:1])
                    data = data[1:]
                    self._wait_a_second()
                sink.sendall(data)
                if not data:
                    sink.shutdown(socket.SHUT_WR)
                    return
            except TimeoutError:
                continue
            except OSError:
                return

    def _wait_a_second(self):
        for _ in range(20):
            if not self.dribbles.is_set() or self.over.wait(0.05):
                return

    def close(self):
        self.over.set()
        self.dribbles.clear()
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for thread in self.threads:
            thread.join()
        for end in self.ends:
            end.close()
        self.server.close()
