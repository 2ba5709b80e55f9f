"""The API as an OpenAPI 3.1 document, made from the structs of the wire."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

import peaking
from peaking.server import wire
from peaking.server.responses import PROBLEM_JSON

BINARY = "application/octet-stream"


@dataclass(frozen=True)
class Operation:
    """One address and method: what goes in and what comes out."""

    method: str
    path: str
    summary: str
    answer: Any = None
    body: Any = None
    status: int = 200
    query: tuple[str, ...] = ()
    media: str = "application/json"
    refusals: tuple[tuple[int, Any], ...] = ()
    """Problems with more fields than the usual ones, by status."""
    needs: Literal["nothing", "device", "console"] = "device"
    """Whose credential is needed."""


_SESSION = "/api/v1/sessions/{session}"
_CAPTURE = _SESSION + "/captures/{capture}"
_FRAME = "/api/v1/recordings/{recording}/frames/{index}"

OPERATIONS = (
    Operation("get", "/api/v1/server", "What this server is", wire.ServerInfo),
    Operation("post", "/api/v1/pair", "Pair a device", wire.Paired, wire.Pairing, needs="nothing"),
    Operation("get", "/api/v1/devices", "The paired devices", wire.PairedDevices),
    Operation("post", "/api/v1/devices/codes", "A code for another device", wire.PairingLink),
    Operation("delete", "/api/v1/devices/{device}", "Revoke a device", status=204),
    Operation("get", "/api/v1/openapi.json", "This document", dict[str, Any]),
    Operation(
        "get", "/api/v1/events", "News of all sessions", wire.ServerEvent, media="text/event-stream"
    ),
    Operation("get", "/api/v1/sessions", "All sessions", list[wire.SessionSummary]),
    Operation("get", _SESSION, "A session with its captures", wire.Session),
    Operation("put", _SESSION, "Begin a session", wire.Session, wire.NewSession, status=201),
    Operation(
        "patch",
        _SESSION,
        "Rename, finish, delete or restore it",
        wire.SessionSummary,
        wire.SessionChange,
    ),
    Operation("delete", _SESSION, "Erase it for ever", status=204),
    Operation(
        "get",
        _SESSION + "/events",
        "News of a session",
        wire.SessionEvent,
        query=("watch",),
        media="text/event-stream",
    ),
    Operation("get", _SESSION + "/peaked", "Peaked share over time", wire.PeakedSamples),
    Operation(
        "put",
        _SESSION + "/peaked/{batch}",
        "Tell peaked shares",
        body=wire.PeakedSamples,
        status=204,
    ),
    Operation(
        "get",
        _SESSION + "/selection",
        "The captures that a policy would keep",
        wire.Selection,
        query=tuple(wire.SelectionQuery.__struct_fields__),
    ),
    Operation("get", _SESSION + "/guidance", "Where next, and what is left", wire.Guidance),
    Operation("get", _SESSION + "/training", "How far its training is", wire.Training),
    Operation(
        "put",
        _SESSION + "/training",
        "Train 3D Gaussians, or stop",
        wire.Training,
        wire.TrainingChange,
    ),
    Operation(
        "get", _SESSION + "/training/splat/{version}", "What came out of it", bytes, media=BINARY
    ),
    Operation(
        "get",
        _SESSION + "/dataset.zip",
        "The data set, or that of the best captures",
        bytes,
        query=tuple(wire.DatasetQuery.__struct_fields__),
        media="application/zip",
    ),
    Operation("put", _CAPTURE, "Upload a capture", wire.Capture, bytes, status=201),
    Operation("delete", _CAPTURE, "Undo a capture", wire.Capture),
    Operation(
        "patch",
        _CAPTURE,
        "Restore a capture, or end it in one of three ways",
        wire.Capture,
        wire.CaptureChange,
    ),
    Operation("get", _CAPTURE + "/mpi", "Its first MPI", bytes, media=BINARY),
    Operation("get", _CAPTURE + "/mpi/{version}", "A version of its MPI", bytes, media=BINARY),
    Operation("get", _CAPTURE + "/photo", "Its photo", bytes, media="image/jpeg"),
    Operation("get", _CAPTURE + "/points", "What it sees, as points", bytes, media=BINARY),
    Operation("get", _CAPTURE + "/thumbnail", "A small photo", bytes, media="image/jpeg"),
    Operation("get", "/api/v1/recordings/{recording}", "A recording", wire.RecordingIndex),
    Operation("get", _FRAME + "/photo", "A recorded picture", bytes, media="image/jpeg"),
    Operation("get", _FRAME + "/depth", "A recorded depth map", bytes, media=BINARY),
)


def document(operations: Sequence[Operation] = OPERATIONS) -> dict[str, Any]:
    """Return the OpenAPI document of these operations."""
    kinds = [
        kind
        for operation in operations
        for kind in (
            operation.answer,
            operation.body,
            *(refusal for _, refusal in operation.refusals),
        )
        if kind not in (None, bytes)
    ]
    schemas, components = msgspec.json.schema_components(
        [*kinds, wire.Problem, wire.CaptureHeader], ref_template="#/components/schemas/{name}"
    )
    schema_of = {id(kind): schema for kind, schema in zip(kinds, schemas, strict=False)}
    paths: dict[str, dict[str, Any]] = {}
    for operation in operations:
        paths.setdefault(operation.path, {})[operation.method] = _operation(operation, schema_of)
    return {
        "openapi": "3.1.0",
        "info": {"title": "peaking", "version": peaking.__version__},
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {
                name: {"type": "http", "scheme": "bearer"}
                for name in sorted({operation.needs for operation in operations} - {"nothing"})
            },
        },
        "security": [{"device": []}],
    }


def _operation(operation: Operation, schema_of: dict[int, Any]) -> dict[str, Any]:
    answer: dict[str, Any] = {"description": operation.summary}
    if operation.answer is not None:
        answer["content"] = _content(operation.answer, operation.media, schema_of)
    problem = {"$ref": "#/components/schemas/Problem"}
    refusal = {
        "description": "Refused",
        "content": {PROBLEM_JSON: {"schema": problem}},
    }
    described: dict[str, Any] = {
        "summary": operation.summary,
        "responses": {str(operation.status): answer, "4XX": refusal, "5XX": refusal},
        "parameters": [
            *(_parameter(name) for name in re.findall(r"{(\w+)}", operation.path)),
            *(
                {"name": name, "in": "query", "schema": {"type": "string"}}
                for name in operation.query
            ),
        ],
    }
    for status, refused in operation.refusals:
        described["responses"][str(status)] = {
            "description": "Refused",
            "content": _content(refused, PROBLEM_JSON, schema_of),
        }
    if operation.needs == "nothing":
        described["security"] = []
    elif operation.needs != "device":
        described["security"] = [{operation.needs: []}]
    if operation.status == 201:
        described["responses"]["200"] = answer
    if operation.body is not None:
        media = BINARY if operation.body is bytes else "application/json"
        described["requestBody"] = {
            "required": True,
            "content": _content(operation.body, media, schema_of),
        }
    return described


def _content(kind: Any, media: str, schema_of: dict[int, Any]) -> dict[str, Any]:
    binary = {"type": "string", "format": "binary"}
    return {media: {"schema": binary if kind is bytes else schema_of[id(kind)]}}


def _parameter(name: str) -> dict[str, Any]:
    kind: dict[str, Any] = {"type": "string"}
    if name in ("index", "version"):
        kind = {"type": "integer", "minimum": 0}
    elif name in ("session", "capture", "batch"):
        kind = msgspec.json.schema(wire.Id)
    return {"name": name, "in": "path", "required": True, "schema": kind}
