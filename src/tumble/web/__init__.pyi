from .server import Hub as Hub, PageServer as PageServer
