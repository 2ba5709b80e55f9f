"""Pictures from anywhere: looked at before they are decoded, and rid of what they tell of people.

`jpeg` and `png` walk over the parts of a file, `decoding` decodes within `peaking.limits`,
`metadata` takes out where, when and with what a picture was taken.
"""
