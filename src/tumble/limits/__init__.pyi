from .conformity import (
    decide as decide,
    read_limits as read_limits,
    rule_words as rule_words,
    with_limits as with_limits,
)
