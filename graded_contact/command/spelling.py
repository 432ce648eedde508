"""Output in encodings that lack characters: "±" is spelt "+/-", "ω" is spelt "omega"."""

import codecs
import io
import re
import sys
import unicodedata

_SPELT = {
    "±": "+/-", "µ": "u", "°": "deg", "×": "x", "·": "*", "√": "sqrt", "∞": "inf", "≠": "!=",
    "−": "-", "–": "-", "─": "-", "⁄": "/", "→": "->", "⟨": "<", "⟩": ">", "•": "*",
    "‘": "'", "’": "'", "“": '"', "”": '"', "′": "'", "″": '"',
}  # fmt: skip
_POWERS = re.compile("[¹²³\u2070-\u207f]+")
_GREEK = re.compile(r"GREEK (SMALL|CAPITAL) LETTER (\w+)")


def spell_missing_characters() -> None:
    """Makes both output streams of the process spell the characters that they cannot write."""
    codecs.register_error("spelt", _spelt)
    codecs.register(lambda name: _ASCII if name == _ASCII.name else None)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            is_ascii = codecs.lookup(stream.encoding).name == "ascii"
            stream.reconfigure(encoding=_ASCII.name if is_ascii else None, errors="spelt")


def _spelt(error: UnicodeError) -> tuple[str, int]:
    """The handler of characters that an encoding lacks."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    text = _POWERS.sub(lambda power: "^" + unicodedata.normalize("NFKC", power[0]), text)
    return "".join(map(_in_ascii, text)), error.end


def _in_ascii(character: str) -> str:
    if greek := _GREEK.match(unicodedata.name(character, "")):
        word = greek[2].replace("LAMDA", "LAMBDA")
        return word.title() if greek[1] == "CAPITAL" else word.lower()
    # Without accents, with indices in line; for instance "½" becomes "1⁄2", and then "1/2".
    parts = _SPELT.get(character) or unicodedata.normalize("NFKD", character)
    plain = "".join(_SPELT.get(part, part) for part in parts if not unicodedata.combining(part))
    return plain.encode("ascii", "backslashreplace").decode()


# Click takes streams of the encoding "ascii" for misconfigured and writes UTF-8 to them.
_PLAIN = codecs.lookup("ascii")
_ASCII = codecs.CodecInfo(
    _PLAIN.encode, _PLAIN.decode, _PLAIN.streamreader, _PLAIN.streamwriter,
    _PLAIN.incrementalencoder, _PLAIN.incrementaldecoder, name="spelt_ascii",
)  # fmt: skip
