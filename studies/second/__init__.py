"""The second study: what is transferred, and what is it worth where a ship must be avoided?"""
