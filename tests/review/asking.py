"""Requests to a review, as its page sends them, or with other headers."""

import http.client
import json


def ask(server, path, body=None, **headers):
    """Return the status and the answer of a request; a header set to None is not sent."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=20)
    content = None if body is None else json.dumps(body)
    sent = {"Host": f"127.0.0.1:{server.server_port}", "Content-Type": "application/json", "Cookie": server.cookie}
    sent |= {name.replace("_", "-"): value for name, value in headers.items()}
    sent = {name: value for name, value in sent.items() if value is not None}
    connection.request("GET" if body is None else "POST", path, content, sent)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text
