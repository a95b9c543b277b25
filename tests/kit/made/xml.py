"""Elements as text."""

from __future__ import annotations


def element(tag: str, *inside: str, **attributes: object) -> str:
    """One element; attributes that are None are left out, numbers have five decimals."""
    words = "".join(f' {name}="{_text(value)}"' for name, value in attributes.items() if value is not None)
    return f"<{tag}{words}>{''.join(inside)}</{tag}>" if inside else f"<{tag}{words}/>"


def _text(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.5f}" if isinstance(value, float) else str(value)
