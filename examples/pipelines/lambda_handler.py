"""A function as a service (AWS Lambda behind a URL, say): scenario and road in, lifelike scenario out; no disk."""

from __future__ import annotations

import json
from typing import Any

import xosc_lateral as xl


def handler(event: dict[str, Any], context: object = None) -> dict[str, Any]:
    """Body: ``{"scenario": XML, "road": XML, "seed": 1}``; what is wrong with it comes back in a line."""
    body = json.loads(event["body"])
    try:
        result = xl.convert(body["scenario"], road=body["road"], seed=body.get("seed", 0))
    except xl.XoscLateralError as error:
        return {"statusCode": 422, "body": str(error)}
    return {"statusCode": 200, "headers": {"content-type": "application/xml"}, "body": result.data.decode()}
